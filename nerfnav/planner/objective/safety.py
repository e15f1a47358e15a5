"""Safety of a plan: the bound of Eq. 1 step by step, the clearance, and the outcome that they allow.

    bound(t) = sum_b rho(x_b) s(b)      P(collision) <= sum_t bound(t)      (Boole's inequality, twice)

All of it rests on the field's densities, and a bound is no guarantee. In a field with evidence
(field/core/occupancy.py) it is founded on proofs, if `field` is the one to plan in: where space is proven free the
density is 0, however much light fog was learned there, and what is unproven counts as solid. So does what is beyond the
field's box (space/border.py).
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field import Field, GridField, density_and_gradient
from nerfnav.field.core.occupancy import raw_of
from nerfnav.planner.kernels.maps import nearest_dense
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.risk.costs import collision_per_step, expected_hits
from nerfnav.planner.space.border import bordered_density, density_within, room_to_border
from nerfnav.planner.space.scales import scales_of
from nerfnav.planner.steps import FLYABLE, PlanCost, PlanOutcome
from nerfnav.robots import Body, Motion, limit_uses

_CERTAIN = 1.0
"""Expected hits along the path of one body point that count as certain."""
_BISECTIONS = 12
_MOST_SAMPLES = 4_000_000
NEAR_CERTAIN = 0.5
"""Bound on the probability of a collision from which a plan does not count as good: as likely as not."""


@dataclass(frozen=True)
class SafetyConfig:
    """Settings of the safety of a plan."""

    samples_per_step: int = 3
    """Densities taken along each body point's path through a step."""
    threshold: float | None = None
    """Density of the level set that clearance is measured to [1/m]; None: that of maps."""
    reach: float | None = None
    """Distance from the plan within which dense space is searched [m]; None: five bodies."""
    voxel: float | None = None
    """Distance of the densities that are taken [m] in a field that is no grid: thinner things may be missed there.
    None: half a voxel of maps. Of a grid, all nodes are taken."""

    def lengths(self, field: Field, body: Body) -> tuple[float, float, float]:
        """Return threshold [1/m], reach and voxel [m] for a body in a field."""
        scales = scales_of(field, body, threshold=self.threshold)
        reach = scales.reach if self.reach is None else self.reach
        return scales.threshold, reach, 0.5 * scales.voxel if self.voxel is None else self.voxel


@dataclass(frozen=True)
class Safety:
    """Safety of a plan by the field's densities."""

    per_step: Float[Tensor, " n"]
    """Upper bound of the probability of a collision in each step."""
    bound: float
    """Their sum, an upper bound of the probability that the plan collides, at most 1. It counts every body point as
    if it flew alone, so that light fog on many points already brings it to 1."""
    min_clearance_m: float | None
    """Smallest distance of a body point from dense space or from the border of the field's box [m], 0 inside or beyond
    them; None where none is within reach."""
    worst_step: int
    """The step with the largest bound."""


@torch.no_grad()
def assess_safety(field: Field, motion: Motion, body: Body, config: SafetyConfig | None = None) -> Safety:
    """Assess one motion in the field."""
    config = SafetyConfig() if config is None else config
    steps = collision_per_step(field, motion, body, config.samples_per_step)
    clearance = measure_clearance(field, motion, body, config)
    return Safety(steps, min(1.0, steps.sum().item()), clearance, int(steps.argmax()))


@torch.no_grad()
def measure_clearance(field: Field, motion: Motion, body: Body, config: SafetyConfig) -> float | None:
    """Measure the smallest distance of body points from the level set rho = threshold or the border of the field's box
    [m]; None where none is within reach."""
    threshold, reach, voxel = config.lengths(field, body)
    points = body.points_at(motion.states).reshape(-1, 3).to(field.box.lower)
    to_border = room_to_border(field.box, points).min().item()
    if to_border <= 0 or (field.density(points) > threshold).any():
        return 0.0
    border = [] if to_border > reach else [to_border]
    return min([*border, *_to_dense(field, points, (threshold, min(reach, to_border + voxel), voxel))], default=None)


def _to_dense(field: Field, points: Tensor, lengths: tuple[float, float, float]) -> list[float]:
    """Measure the smallest distance of points from the level set rho = threshold [m]; empty where it is out of
    reach."""
    threshold, reach, voxel = lengths
    if isinstance(field, GridField):
        voxel = field.resolution
        distance, solid = _nearest_nodes(field, points, threshold, reach)
    else:
        distance, solid = _nearest_samples(field, points, threshold, reach, voxel)
    if not torch.isfinite(distance).any():
        return []
    near = distance <= distance.min() + voxel
    start, free, solid = points[near], points[near], solid[near]
    for _ in range(_BISECTIONS):  # where the line to the nearest dense node enters the level set
        middle = 0.5 * (free + solid)
        inside = (field.density(middle) > threshold)[:, None]
        free, solid = torch.where(inside, free, middle), torch.where(inside, middle, solid)
    return [(free - start).norm(dim=-1).min().item()]


def _nearest_nodes(field: GridField, points: Tensor, threshold: float, reach: float) -> tuple[Tensor, Tensor]:
    """Find distance [m] and place of the nearest dense node of a grid; infinite where another point is clearly
    nearer."""
    at = points.double().cpu().numpy()
    nodes, slack = np.zeros_like(at), field.resolution
    distance = nearest_dense(*field.kernel_grid, raw_of(threshold), at, reach, slack, nodes)
    return torch.from_numpy(distance).to(points), torch.from_numpy(nodes).to(points)


def _nearest_samples(
    field: Field, points: Tensor, threshold: float, reach: float, voxel: float
) -> tuple[Tensor, Tensor]:
    """Find the same among samples `voxel` [m] apart, some points after the other where they extend over much space."""
    lower = torch.maximum(points.amin(0) - reach, field.box.lower)
    upper = torch.minimum(points.amax(0) + reach, field.box.upper)
    axes = [torch.arange(low, high, voxel) for low, high in zip(lower.tolist(), upper.tolist(), strict=True)]
    if math.prod(len(axis) for axis in axes) > _MOST_SAMPLES and len(points) > 1:
        parts = [_nearest_samples(field, part, threshold, reach, voxel) for part in points.tensor_split(2)]
        distances, places = zip(*parts, strict=True)
        return torch.cat(distances), torch.cat(places)
    nodes = torch.cartesian_prod(*axes).to(points)
    dense = nodes[field.density(nodes) > threshold]
    if len(dense) == 0:
        return points.new_full((len(points),), math.inf), points
    distance, index = scipy.spatial.KDTree(dense.cpu().numpy()).query(points.cpu().numpy(), distance_upper_bound=reach)
    found = torch.from_numpy(np.minimum(index, len(dense) - 1)).to(points.device)
    return torch.from_numpy(distance).to(points), dense[found]


def judge_search(problem: PlanProblem, motion: Motion, cost: PlanCost, outcome: PlanOutcome) -> PlanOutcome:
    """Replace `outcome` by the fault of a plan that a search has ended with, if it has one."""
    if not np.isfinite(cost.total):
        return PlanOutcome.DIVERGED
    outcome = downgrade_outcome(problem, motion, outcome)
    if outcome is not PlanOutcome.IN_COLLISION and any(use.violated for use in limit_uses(problem.robot, motion)):
        return PlanOutcome.OVER_LIMITS
    return outcome


def downgrade_outcome(problem: PlanProblem, motion: Motion, outcome: PlanOutcome) -> PlanOutcome:
    """Downgrade the outcome of a plan that counts as good where the field contradicts.

    A plan that is as likely as not to collide has not converged, nor is it worth more iterations.
    """
    # the bound is a sum over body points: where it is small, none of them is hit for certain
    if outcome not in FLYABLE or _fast_bound(problem, motion) < NEAR_CERTAIN:
        return outcome
    return PlanOutcome.IN_COLLISION if meets_density(problem, motion) else PlanOutcome.LIKELY_COLLISION


def _fast_bound(problem: PlanProblem, motion: Motion) -> float:
    """Compute `collision_probability_bound` with the field's fast densities."""
    points = problem.robot.body.points_at(motion.states).detach().double().cpu().numpy()
    before, moved = points[:-1], np.diff(points, axis=0)
    fractions = (np.arange(SafetyConfig.samples_per_step) + 0.5) / SafetyConfig.samples_per_step
    along = before[:, None] + fractions[:, None, None] * moved[:, None]
    density = torch.from_numpy(density_and_gradient(problem.field, along.reshape(-1, 3))[0]).reshape(along.shape[:3])
    density = density_within(problem.field.box, torch.from_numpy(along), density).numpy()
    return float((density.mean(1) * np.linalg.norm(moved, axis=-1)).sum())


@torch.no_grad()
def meets_density(problem: PlanProblem, motion: Motion) -> bool:
    """Return True if the body comes into something dense or beyond the border, and one of its points is expected to be
    hit.

    One point alone, not the sum of Eq. 1: specks and light fog that all of them pass through bring that above 1 too.
    """
    points = problem.robot.body.points_at(motion.states)
    if (bordered_density(problem.field, points) <= scales_of(problem.field, problem.robot.body).threshold).all():
        return False
    return expected_hits(problem.field, motion, problem.robot.body).max().item() >= _CERTAIN
