"""Query for the voxels of occupied or unseen space."""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import ClassVar

import numpy as np
import torch

from nerfnav.field import UnknownSpace, VoxelField
from nerfnav.planner import OccupancyConfig
from nerfnav_app.places.derived import build_occupancy, prepare_place
from nerfnav_app.places.place import Place
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.session import Session


class Space(Enum):
    """Parts of space that can be shown."""

    OCCUPIED = "where the robot does not fit"
    UNKNOWN = "what no camera saw"


@dataclass(frozen=True)
class SpaceVoxels:
    """Outermost voxels of a part of space."""

    centers: np.ndarray = field(compare=False)
    """Their centres (n, 3) [m]."""
    spacing: float = field(compare=False)
    """Their edge [m]."""


@dataclass(frozen=True)
class SpaceQuery(Query[SpaceVoxels]):
    """Query for the voxels of a part of space."""

    reads_field: ClassVar[bool] = True
    space: Space
    height: float = 0.0
    """Height of a robot on the ground [m]; of others all heights are shown."""

    @property
    def slot(self) -> Hashable:
        """Slot of the part of space."""
        return SpaceQuery, self.space

    @classmethod
    def pending(cls, session: Session) -> Iterator["SpaceQuery"]:
        """Ask for the parts that the view settings show."""
        wanted = {Space.OCCUPIED: session.view_settings.occupied, Space.UNKNOWN: session.view_settings.unknown}
        planar = session.place is not None and session.place.robot.planar
        height = session.ends.start.position[2] if planar else 0.0
        yield from (cls(space, height if space is Space.OCCUPIED else 0.0) for space in Space if wanted[space])

    def answer(self, resources: Resources) -> SpaceVoxels:
        """Find the voxels with a neighbour outside of the part."""
        return _unknown(resources.place) if self.space is Space.UNKNOWN else _occupied(resources.place, self.height)


def _occupied(place: Place, height: float) -> SpaceVoxels:
    occupancy = build_occupancy(prepare_place(place, UnknownSpace.OCCUPIED), OccupancyConfig(), height)
    indices = torch.from_numpy(np.argwhere(_shell(occupancy.dense.any(0).numpy())))
    return SpaceVoxels(occupancy.centers(indices).numpy(), occupancy.spacing.mean().item())


def _unknown(place: Place) -> SpaceVoxels:
    """Find unseen space at every second node, which is as much as a page draws at once."""
    field = place.field
    if not isinstance(field, VoxelField) or field.unknown is None:
        return SpaceVoxels(np.zeros((0, 3), np.float32), 0.0)
    inside = _shell(field.unknown.cpu().numpy()[::2, ::2, ::2])
    centers = field.box.lower.cpu().numpy() + 2 * np.argwhere(inside) * field.spacing.cpu().numpy()
    return SpaceVoxels(centers.astype(np.float32), 2 * field.spacing.mean().item())


def _shell(inside: np.ndarray) -> np.ndarray:
    """Find voxels (nx, ny, nz) that are inside and have a neighbour that is not."""
    padded = np.pad(inside, 1, constant_values=True)  # the wall of the box is no surface
    core = np.ones_like(inside)
    for axis in range(3):
        for step in (-1, 1):
            core &= np.roll(padded, step, axis)[1:-1, 1:-1, 1:-1]
    return inside & ~core
