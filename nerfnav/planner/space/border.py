"""Border of a field's box: space beyond it is unproven, so the whole body must stay inside.

Fields are empty beyond their boxes, as rendering needs it. For planning, that space counts as unproven, and unproven
space as solid:

- judges (bounds, clearance, ends) take `density_within`: space beyond is as dense as solid space;
- maps have no place for a body that would reach beyond (`mark_beyond`);
- J has the penalty `outside`, which begins a little before the border, for it ends a little beyond what it bounds.
"""

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.field import Field
from nerfnav.field.core.occupancy import SOLID_RAW, density_of
from nerfnav.geometry import Box
from nerfnav.planner.kernels.terms import SMOOTH
from nerfnav.robots import Body, Motion

SOLID_BEYOND = density_of(SOLID_RAW)
"""Density of what is beyond the border [1/m]: that of unproven space."""
_RIM = 1e-5
"""Share of the box by which rounding may put a point beyond its border that is on it."""
_EARLY = 0.05
"""Share of the body's width by which the penalty begins before the border."""


def is_beyond(box: Box, points: Float[Tensor, "*batch 3"]) -> Bool[Tensor, "*batch"]:
    """Mark points [m] beyond the border."""
    lower, upper = (edge.to(points) for edge in (box.lower, box.upper))
    rim = _RIM * (upper - lower)
    edges = zip(points.unbind(-1), lower - rim, upper + rim, strict=True)
    x, y, z = ((along < low) | (along > high) for along, low, high in edges)  # `any(-1)` takes four times as long
    return x | y | z


def density_within(
    box: Box, points: Float[Tensor, "*batch 3"], density: Float[Tensor, "*batch"]
) -> Float[Tensor, "*batch"]:
    """Return a field's density at points [1/m], and beyond its border that of solid space."""
    return torch.where(is_beyond(box, points), torch.full_like(density, SOLID_BEYOND), density)


def bordered_density(field: Field, points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch"]:
    """`density_within` of a field, differentiable as the field is."""
    return density_within(field.box, points, field.density(points))


def holds_level(box: Box, body: Body, points: Float[Tensor, "n 3"]) -> Bool[Tensor, " n"]:
    """Mark the points [m] at which the whole body is in the box as long as it is level, with any heading."""
    side, tall = 0.5 * max(body.extents[:2]), 0.5 * body.extents[2]
    reach = points.new_tensor([side, side, tall])
    return ~(is_beyond(box, points - reach) | is_beyond(box, points + reach))


def room_to_border(box: Box, points: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
    """Measure the distance of points in the box to its border [m]; at most 0 beyond."""
    return torch.minimum(points - box.lower.to(points), box.upper.to(points) - points).amin(-1)


def reach_of(body: Body) -> Float[np.ndarray, "3"]:
    """Return half of the body's edges [m], with the distance by which the penalty begins before the border."""
    return 0.5 * np.array(body.extents) + _EARLY * min(body.extents[:2])


def outside(box: Box, motion: Motion, body: Body) -> Float[Tensor, "*batch"]:
    """Sum the squared distance by which the box around the body reaches beyond the border over sides and time [m^2].

    An edge of half length h along the body's axis j reaches h |R_ij| along the world's axis i; the absolute value is
    taken as sqrt(R_ij^2 + SMOOTH).
    """
    position, rotation = motion.states.position, motion.states.rotation
    reach = (rotation.square() + SMOOTH).sqrt() @ torch.from_numpy(reach_of(body)).to(position)
    lower, upper = box.lower.to(position), box.upper.to(position)
    below, above = (lower - position + reach).clamp_min(0), (position + reach - upper).clamp_min(0)
    return (below.square() + above.square()).sum((-2, -1))


def mark_beyond(marked: np.ndarray, headings: list[float], body: Body, box: Box, height: float | None) -> None:
    """Mark where a level body would reach beyond the border: places (m, nx, ny, nz) in the box, with each heading
    [rad], a single one of which stands for any; with a `height` [m] those of it alone."""
    size, rim = box.size.double().numpy(), _RIM * box.size.double().numpy()
    length, width, tall = body.extents
    if height is not None and not _holds(box, 2, height - 0.5 * tall, height + 0.5 * tall):
        marked[:] = 1
    for heading, places in zip(headings, marked, strict=True):
        cosine, sine = abs(np.cos(heading)), abs(np.sin(heading))
        turned = (length * cosine + width * sine, length * sine + width * cosine, tall)
        edges = (max(length, width), max(length, width), tall) if len(headings) == 1 else turned
        for axis in range(3 if height is None else 2):
            across = np.moveaxis(places, axis, 0)
            near = int(np.ceil((0.5 * edges[axis] - rim[axis]) * (len(across) - 1) / size[axis]))
            across[: max(near, 0)] = 1
            across[max(len(across) - near, 0) :] = 1


def _holds(box: Box, axis: int, lower: float, upper: float) -> bool:
    """Return True if the box spans an interval [m] along an axis."""
    rim = _RIM * float(box.size[axis])
    return float(box.lower[axis]) - rim <= lower and upper <= float(box.upper[axis]) + rim
