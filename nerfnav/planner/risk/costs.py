"""Sums of Eq. 1 and Eq. 2: pure functions of a field and a motion, one for each, all of shape "*batch".

Notation: rho density [1/m], b a body point, x_b(t) = p_t + R_t b its place in the world, u the action, Gamma
diagonal.

    J = collision * sum_t sum_b rho(x_b) s(b)  +  control * sum_t u_t' Gamma u_t  +  penalties

s(b) is the distance that body point b itself travels in the step (rotation moves the corners of a body whose centre
rests). Paper Eq. 1 prints >= between the collision probability and the sum; Boole's inequality gives <=.

terms/ makes them terms of J, and says how to add another one.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field import Field, density_at
from nerfnav.planner.space.border import density_within
from nerfnav.planner.space.scales import poses_along
from nerfnav.robots import Body, Motion

_STANDSTILL = 1e-12
"""Squared distance [m^2] that keeps the derivative of a distance finite where nothing moves."""


@dataclass(frozen=True)
class CostWeights:
    """Weights of the terms of J.

    The authors' later code differs from the paper: it squares the density, multiplies by the centre's distance
    only, and takes torques to the fourth power. These terms follow the paper.
    """

    collision: float = 1.0
    """Weight of the collision term; 1 in the paper."""
    control: float = 0.1
    """Scale of Gamma, whose diagonal is the robot's `action_weights`; the paper does not print its Gamma. With 1, to
    hover would cost as much in a step as a certain collision, and plans would graze what they pass."""
    limits: float = 100.0
    """Weight of the robot's own `limits`, such as a thrust floor; not in the paper."""
    outside: float = 1000.0
    """Weight of reaching beyond the field's box with the body [1/m^2], see terms/outside.py; not in the paper."""
    risk: float = 0.0
    """Cost of a collision due to the noise to come [J]; 0 in the paper, which plans without noise. See
    terms/risk.py."""
    samples_per_step: int = 3
    """Densities taken along each body point's path through a step. The paper takes 1, at the end of the step: then
    a body slips between two waypoints through what is thinner than a step."""

    margin: float = 0.01
    """Distance by which the body points reach beyond the body [m]: about a voxel, since a field's surfaces are no more
    exact than that. 0 in the paper. Flights keep more room, for they are disturbed."""


def collision_per_step(
    field: Field, motion: Motion, body: Body, samples_per_step: int = 1
) -> Float[Tensor, "*batch n"]:
    """Compute sum_b rho(x_b) s(b) of every step: an upper bound of its collision probability (Eq. 1).

The path of each body point through a step is cut into `samples_per_step` equal parts, and the density is taken in
    the middle of each. What is beyond the field's box counts as solid.
    """
    return _met(field, motion, body, samples_per_step, bordered=True).sum(-1)


def collision(field: Field, motion: Motion, body: Body, samples_per_step: int = 1) -> Float[Tensor, "*batch"]:
    """Compute the collision term of J, summed over time: without a jump at the border of the field's box, within which
    the penalty of terms/outside.py keeps the body."""
    return _met(field, motion, body, samples_per_step, bordered=False).sum((-2, -1))


def _met(
    field: Field, motion: Motion, body: Body, samples_per_step: int, bordered: bool
) -> Float[Tensor, "*batch n b"]:
    """Compute rho(x_b) s(b) of every step and body point."""
    points = body.points_at(motion.states)
    before, moved = points[..., :-1, :, :], points.diff(dim=-3)
    travelled = (moved.square().sum(-1) + _STANDSTILL).sqrt()
    fractions = (torch.arange(samples_per_step, dtype=points.dtype, device=points.device) + 0.5) / samples_per_step
    along = before[..., None, :] + fractions[:, None] * moved[..., None, :]
    density = field.density(along)
    if bordered:
        density = density_within(field.box, along, density)
    return density.mean(-1) * travelled


def control(motion: Motion, gamma: Float[Tensor, " a"]) -> Float[Tensor, "*batch"]:
    """Compute sum_t u_t' Gamma u_t with the diagonal `gamma`."""
    return (gamma * motion.actions.square()).sum((-2, -1))


@dataclass(frozen=True)
class PathDensity:
    """Density along the paths of a body's points, between the way points of a motion too."""

    density: Float[Tensor, "m b"]
    """In the middle of each of m short parts of the path of each body point [1/m]; beyond the box that of solid
    space."""
    hits: Float[Tensor, "n b"]
    """rho(x_b) s(b) of each of the n steps of the motion and body point: the expected number of hits."""

    @property
    def bound_per_step(self) -> Float[Tensor, " n"]:
        """Upper bound of the probability of a collision in each step (Eq. 1)."""
        return self.hits.sum(-1)

    @classmethod
    @torch.no_grad()
    def of(cls, field: Field, motion: Motion, body: Body) -> "PathDensity":
        """Measure it along one motion, at poses at most half a voxel of maps apart."""
        poses, starts = poses_along(field, motion, body)
        points = body.points_at(poses).double()
        middles = 0.5 * (points[:-1] + points[1:])
        found = density_at(field, middles.reshape(-1, 3).cpu().numpy())
        density = torch.from_numpy(found).reshape(middles.shape[:-1])
        density = density_within(field.box, middles, density.to(middles.device))
        met = density * points.diff(dim=0).norm(dim=-1)
        step = torch.arange(len(starts) - 1).repeat_interleave(starts.diff()).to(met.device)
        return cls(density, met.new_zeros(len(starts) - 1, met.shape[1]).index_add(0, step, met))


def collision_probability_bound(field: Field, motion: Motion, body: Body) -> float:
    """Bound the probability that one motion collides, at most 1: Eq. 1, and Boole's inequality over steps.

    It rests on the field's densities and is no guarantee. It counts every body point as if it flew alone, so that
    light fog on many points already brings it to 1; what is beyond the field's box counts as solid. The density is
    taken between the way points too (`PathDensity`).
    """
    return min(1.0, PathDensity.of(field, motion, body).bound_per_step.sum().item())
