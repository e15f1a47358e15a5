"""Occupancy grid of a field: each voxel is free, solid or unproven for planners, before any body is put into it.

Free is where the density stays below a threshold and cameras have shown it. Solid is where the field is dense.
Unproven is all space that is not proven free. The share of unproven space is reported to users in a sentence.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.core.occupancy import Occupancy, UnknownSpace, unproven_shares
from nerfnav.field.core.protocol import Field, density_in_box
from nerfnav.field.models.grid_field import GridField

MOST_VOXELS = 100_000_000
"""A finer grid than that of any field: a byte for each voxel, and some more while it is made."""
_ROUNDING = 1e-3
"""Share of a voxel by which the box may stick out of the grid: sizes are kept in single precision."""


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
    """Classify the space of a field as planners do, in voxels of an edge [m] (default: the distance of its nodes).

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
    solid, planned = _solid(field, threshold, axes, edge), field.planning_view(UnknownSpace.OCCUPIED)
    occupied = solid if planned is field else _solid(planned, threshold, axes, edge)
    state = np.where(solid, Occupancy.SOLID, np.where(occupied, Occupancy.UNPROVEN, Occupancy.FREE))
    return OccupancyGrid(state.astype(np.uint8), lower - 0.5 * edge, edge)


def _solid(
    field: GridField, threshold: float, axes: list[np.ndarray], edge: float
) -> Bool[np.ndarray, "nx ny nz"]:
    """Mark the dense voxels on the lattice of three axes [m], one plane after the other."""
    parts = [(0.0, 0.0, 0.0), *itertools.product((-0.25, 0.25), repeat=3)]
    across = np.stack(np.meshgrid(*axes[1:], indexing="ij"), -1).reshape(-1, 2)
    planes = []
    for x in axes[0]:
        middles = np.concatenate([np.full((len(across), 1), x), across], -1)
        found = np.zeros(len(middles), bool)
        for part in parts:
            # the outermost voxels stick out of the box: beyond its border they are as at it
            found |= density_in_box(field, middles + edge * np.array(part)) > threshold
        planes.append(found)
    return np.stack(planes).reshape([len(axis) for axis in axes])


_WORTH_REPORTING = 0.2
"""Share of the box: the inside of stones and of the ground is unproven everywhere."""
_LAYERS = ("the floor", "what stands at half its height", "what is high up")
"""Content of the lowest, the middle and the highest third of a box, for the user."""


def describe_unproven(field: Field) -> str:
    """Describe for the user what is not proven, and what would help; empty where nearly everything is."""
    unproven = unproven_shares(field)
    if not isinstance(field, GridField) or unproven is None:
        return "Free space is not proven here: plans trust the field alone."
    share = float(unproven.mean())
    if share < _WORTH_REPORTING:
        return ""
    layers = [float(part.sum()) for part in unproven.tensor_split(len(_LAYERS))]
    where = _LAYERS[layers.index(max(layers))]
    sentence = f"{share:.0%} of this place is unproven and counts as solid"
    if field.info.proven_from == "mesh":
        return f"{sentence}: no way from where a camera may stand leads to {where}."
    if field.info.truth:
        return f"{sentence}: a field baked from its mesh (nerfnav train --baked) proves more of {where}."
    means = "more photographs" if field.info.proven_from == "depth" else "more photographs, or depth maps,"
    return f"{sentence}: {means} of {where} would help most."
