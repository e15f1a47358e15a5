"""Occupancy grid of a field: each voxel is free, solid or unproven for planners, before any body is put into it.

Free is where the density stays below a threshold and cameras have shown it. Solid is where the field is dense.
Unproven is all space that is not proven free: planners take it for solid unless they are told otherwise
(`UnknownSpace`), and `planning_field` is the field to plan in. The share of unproven space is told in a sentence for
users.
"""


import itertools
from dataclasses import dataclass, replace
from enum import Enum, IntEnum

import numpy as np
from jaxtyping import Bool, Float, UInt8

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.core.protocol import Field
from nerfnav.field.models.grid_field import GridField
from nerfnav.field.render.composite import CompositeField


class UnknownSpace(Enum):
    """What planners take unproven space for."""

    OCCUPIED = "occupied"
    """As solid: a hollow stone is no corridor, and a plain wall may be anywhere."""
    FREE = "free"
    """As the field says."""


def planning_field(field: Field, unknown: UnknownSpace) -> Field:
    """What to plan in: `field` with nothing in it where that is proven, and its unproven nodes solid or as they are.

    Made once for each field. Fields without evidence stay as they are; of a composite field this is said for each
    part.
    """
    if isinstance(field, CompositeField):
        return CompositeField(tuple(replace(part, field=planning_field(part.field, unknown)) for part in field.parts))
    if not isinstance(field, GridField) or field.evidence is None:
        return field
    return field.planned if unknown is UnknownSpace.OCCUPIED else field.planned_as_it_says


MOST_VOXELS = 100_000_000
"""A finer grid than that of any field: a byte for each voxel, and some more while it is made."""
_ROUNDING = 1e-3
"""Share of a voxel by which the box may stick out of the grid: sizes are kept in single precision."""


class Occupancy(IntEnum):
    """What planners believe of a voxel."""

    FREE = 0
    """Nothing is there."""
    SOLID = 1
    """Something is there."""
    UNPROVEN = 2
    """Nobody knows."""


@dataclass(frozen=True)
class OccupancyGrid:
    """Cubes side by side: voxel (i, j, k) reaches from lower + voxel (i, j, k) to lower + voxel (i + 1, j + 1, k + 1).
    """

    state: UInt8[np.ndarray, "nx ny nz"]
    """Values of Occupancy."""
    lower: Float[np.ndarray, "3"]
    """Lowest corner of the lowest voxel [m]."""
    voxel: float
    """Edge of a voxel [m]."""

    def share(self, state: Occupancy) -> float:
        """Share of all voxels that are in a state."""
        return float(np.mean(self.state == state))

    def at(self, points: Float[np.ndarray, "n 3"]) -> UInt8[np.ndarray, " n"]:
        """States at world points [m]; outside the grid all is unproven."""
        index = np.floor((points - self.lower) / self.voxel).astype(int)
        inside = ((index >= 0) & (index < self.state.shape)).all(-1)
        found = np.full(len(points), Occupancy.UNPROVEN, np.uint8)
        found[inside] = self.state[tuple(index[inside].T)]
        return found

    def layer(self, height: float) -> UInt8[np.ndarray, "nx ny"]:
        """The voxels at a height [m]. Raises InvalidInputError where there are none."""
        low, high = self.lower[2], self.lower[2] + self.voxel * self.state.shape[2]
        if not low <= height <= high:
            raise InvalidInputError(f"the map is {low:.3g} to {high:.3g} m high: there is no slice at {height:g} m")
        return self.state[..., min(int((height - low) / self.voxel), self.state.shape[2] - 1)]


def compute_occupancy_grid(field: Field, threshold: float, voxel: float | None = None) -> OccupancyGrid:
    """What planners believe of a field, in voxels of an edge [m] (default: the distance of its nodes).

    The first voxel has its middle at the box's lowest corner, so that voxels stand around nodes where both are as
    large. One is solid where the density exceeds `threshold` [1/m] at its middle, or at the middle of an eighth of it.
    Raises InvalidInputError for a field that has no voxels, and for a grid that is too fine.
    """
    if not isinstance(field, GridField):
        raise InvalidInputError("a map is made of a field of voxels: bake this one first, with nerfnav bake")
    edge = float(field.spacing.min()) if voxel is None else voxel
    lower, upper = (corner.double().cpu().numpy() for corner in (field.box.lower, field.box.upper))
    counts = np.ceil((upper - lower) / edge + 0.5 - _ROUNDING).astype(int)
    if np.prod(counts.astype(float)) > MOST_VOXELS:
        raise InvalidInputError(
            f"a map of {field.box.describe()} with voxels of {edge:g} m would have more than {MOST_VOXELS} of them: "
            "choose a larger voxel"
        )
    axes = [low + edge * np.arange(count) for low, count in zip(lower, counts, strict=True)]
    solid = _solid(field, threshold, axes, edge)
    believed = planning_field(field, UnknownSpace.OCCUPIED)
    assert isinstance(believed, GridField)  # as the field is
    taken = solid if believed is field else _solid(believed, threshold, axes, edge)
    state = np.where(solid, Occupancy.SOLID, np.where(taken, Occupancy.UNPROVEN, Occupancy.FREE))
    return OccupancyGrid(state.astype(np.uint8), lower - 0.5 * edge, edge)


def _solid(
    field: GridField, threshold: float, axes: list[np.ndarray], edge: float
) -> Bool[np.ndarray, "nx ny nz"]:
    """Which voxels with their middles on the lattice of three axes [m] are dense, one plane after the other."""
    lower, upper = (corner.double().cpu().numpy() for corner in (field.box.lower, field.box.upper))
    parts = [(0.0, 0.0, 0.0), *itertools.product((-0.25, 0.25), repeat=3)]
    across = np.stack(np.meshgrid(*axes[1:], indexing="ij"), -1).reshape(-1, 2)
    planes = []
    for x in axes[0]:
        middles = np.concatenate([np.full((len(across), 1), x), across], -1)
        found = np.zeros(len(middles), bool)
        for part in parts:
            # the outermost voxels stick out of the box: beyond its border they are as at it
            points = np.clip(middles + edge * np.array(part), lower, upper)
            found |= field.density_and_gradient(points)[0] > threshold
        planes.append(found)
    return np.stack(planes).reshape([len(axis) for axis in axes])


_WORTH_SAYING = 0.2
"""Share of the box: what is inside stones and under the ground is unproven everywhere."""
_LAYERS = ("the floor", "what stands at half its height", "what is high up")
"""What photographs of the lowest, the middle and the highest third of a box show."""


def describe_unproven(field: Field) -> str:
    """A sentence that says what is not proven, and what would help; empty where nearly everything is."""
    unproven = field.unproven_by_height if isinstance(field, GridField) else None
    if not isinstance(field, GridField) or unproven is None:
        return "Nothing proves what is free here: plans trust the field alone."
    share = float(unproven.mean())
    if share < _WORTH_SAYING:
        return ""
    layers = [float(part.sum()) for part in unproven.tensor_split(len(_LAYERS))]
    where = _LAYERS[layers.index(max(layers))]
    means = "more photographs" if field.info.proven_from == "depth" else "more photographs, or depth maps,"
    return f"{share:.0%} of this place is unproven and counts as solid: {means} of {where} would help most."
