"""Composite field: several fields, each with a rigid pose, as one, so that parts can be moved without training again.

Notation: part k has density rho_k and colour c_k in its own frame, and the pose R_k, t_k in the world, so that a
world point p is p_k = R_k' (p - t_k) there. Light is stopped by all parts, and where they overlap their colours mix:

    rho(p) = sum_k rho_k(p_k)      c(p, d) = sum_k rho_k(p_k) c_k(p_k, R_k' d) / rho(p)
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.core.occupancy import UnknownSpace, planning_field
from nerfnav.field.core.protocol import (
    Field,
    Points,
    RaySamples,
    bins_in_box,
    chosen_samples,
    density_and_gradient,
)
from nerfnav.field.render.surroundings import Backdrop, Rays
from nerfnav.field.render.volume_rendering import HasBackdrop
from nerfnav.geometry import Box, Pose

_NO_DENSITY = 1e-6  # [1/m]: where all parts together have less, the first one says the colour
_ROUNDING = 1e-3  # of a step: samples on a border between two bins belong to one of them


@dataclass(frozen=True)
class PlacedField:
    """A field somewhere in the world."""

    field: Field
    """In its own frame."""
    pose: Pose
    """T_world_field, rigid, without batch dimensions."""

    def local(self, points: Points) -> Points:
        """World points [m] in the field's frame."""
        return (points - self.pose.position.to(points)) @ self.pose.rotation.to(points)

    def turned(self, directions: Points) -> Points:
        """Directions of the world in the field's axes."""
        return directions @ self.pose.rotation.to(directions)

    @cached_property
    def box(self) -> Box:
        """The smallest box of the world around the field's own."""
        corners = torch.cartesian_prod(*torch.stack([self.field.box.lower, self.field.box.upper]).unbind(1))
        placed = corners @ self.pose.rotation.to(corners).T + self.pose.position.to(corners)
        return Box(placed.amin(0), placed.amax(0))


@dataclass(frozen=True)
class CompositeField:
    """Placed fields as one field; the first one gives the background."""

    parts: tuple[PlacedField, ...]
    """At least one."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError without parts, or with a pose that is not rigid."""
        if not self.parts:
            raise InvalidInputError("a composite field needs at least one part")
        for part in self.parts:
            rotation = part.pose.rotation.double()
            off = (rotation @ rotation.T - torch.eye(3, dtype=torch.float64, device=rotation.device)).abs().max()
            if not (off < 1e-4 and torch.linalg.det(rotation) > 0 and bool(part.pose.position.isfinite().all())):
                raise InvalidInputError("the pose of a part must be a rotation and a finite position")

    def moved(self, index: int, pose: Pose) -> "CompositeField":
        """The same with part `index` elsewhere; nothing is computed, so it may be done at every step of a flight."""
        parts = list(self.parts)
        parts[index] = replace(parts[index], pose=pose)
        return CompositeField(tuple(parts))

    @property
    def box(self) -> Box:
        """The smallest box around all parts."""
        return self._box

    @cached_property
    def _box(self) -> Box:
        boxes = [part.box for part in self.parts]
        lower, upper = torch.stack([box.lower for box in boxes]), torch.stack([box.upper for box in boxes])
        return Box(lower.amin(0), upper.amax(0))

    @property
    def background(self) -> Float[Tensor, "3"]:
        """Background of the first part."""
        return self.parts[0].field.background

    @property
    def resolution(self) -> float:
        """Resolution of the finest part [m]."""
        return min(part.field.resolution for part in self.parts)

    def planning_view(self, unknown: UnknownSpace) -> "CompositeField":
        """Return the field as planners take it: that of each part."""
        return CompositeField(tuple(replace(part, field=planning_field(part.field, unknown)) for part in self.parts))

    def density(self, points: Points) -> Float[Tensor, "*batch"]:
        """rho at world points [1/m]: the sum over the parts."""
        return torch.stack(self._densities(points)).sum(0)

    def radiance(self, points: Points, directions: Points) -> Points:
        """The parts' colours, each weighted by its density there."""
        colors = [part.field.radiance(part.local(points), part.turned(directions)) for part in self.parts]
        densities = self._densities(points)
        mixed = sum(density[..., None] * color for density, color in zip(densities, colors, strict=True))
        return (mixed + _NO_DENSITY * colors[0]) / (torch.stack(densities).sum(0) + _NO_DENSITY)[..., None]

    @torch.no_grad()
    def samples(self, origins: Rays, directions: Rays) -> RaySamples:
        """The union of the parts' samples, at the finest step among them."""
        found = [part.field.samples(part.local(origins), part.turned(directions)) for part in self.parts]
        step = min(samples.step for samples in found)
        enter, inside = bins_in_box(self.box.to(origins), origins, directions, step)
        covered = torch.zeros(len(origins), inside.shape[1] + 1, device=origins.device)
        for samples in found:
            _mark(covered, samples, enter, step)
        return chosen_samples((covered.cumsum(1)[:, :-1] > 0.5) & inside, enter, step)

    def backdrop(self, origins: Rays, directions: Rays) -> Backdrop | None:
        """Render the surroundings of the first part; None where that is the background."""
        first = self.parts[0]
        if not isinstance(first.field, HasBackdrop):
            return None
        return first.field.backdrop(first.local(origins), first.turned(directions))

    def density_and_gradient(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """rho (n) [1/m] and its gradient (n, 3) [1/m^2] at world points (n, 3) [m], by the parts' own fast ways."""
        density, gradient = np.zeros(len(points)), np.zeros((len(points), 3))
        for part in self.parts:
            rotation, position = (side.double().cpu().numpy() for side in (part.pose.rotation, part.pose.position))
            there, slope = density_and_gradient(part.field, np.ascontiguousarray((points - position) @ rotation))
            density += there
            gradient += slope @ rotation.T
        return density, gradient

    def _densities(self, points: Points) -> list[Float[Tensor, "*batch"]]:
        return [part.field.density(part.local(points)) for part in self.parts]


def _mark(covered: Float[Tensor, "n b"], samples: RaySamples, enter: Float[Tensor, "n"], step: float) -> None:
    """Add to `covered`, a row of differences for each ray, the bins of `step` metres that samples stand for."""
    last = covered.shape[1] - 1
    reach = 0.5 * samples.step
    offset = samples.distances - enter[:, None]
    first = torch.floor((offset - reach) / step + _ROUNDING).clamp(0, last).long()
    end = torch.ceil((offset + reach) / step - _ROUNDING).clamp(0, last).long()
    weight = samples.mask.to(covered)
    covered.scatter_add_(1, first, weight)
    covered.scatter_add_(1, end, -weight)
