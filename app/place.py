"""A place: a field that a robot can plan in, with the ground truth to judge by where there is one."""

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import scenes
from nerfnav import robots
from nerfnav.errors import NerfnavError, UnknownNameError
from nerfnav.field.checkpoint import load_field
from nerfnav.field.voxel import VoxelField
from nerfnav.planner.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.robots.robot import Robot
from nerfnav.world.scene import Scene, Task


class NoTrainedFieldError(NerfnavError):
    """A scene whose field has not been trained yet."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where jobs happen. Two places are the same only if they are the same object."""

    name: str
    """Name of the scene, or of the field's file."""
    field: VoxelField
    """What is planned in."""
    scene: Scene | None
    """The ground truth that the field was trained from; None where there is none."""
    robot: Robot
    """What moves."""

    @property
    def tasks(self) -> tuple[Task, ...]:
        """What is asked of this robot here; none without a ground truth."""
        return self.scene.tasks if self.scene is not None else ()


def open_place(what: str, robot: str = "quadrotor") -> Place:
    """Open a bundled scene by name, or a field file by path.

    A field that was trained from a bundled scene finds that scene again as its ground truth.
    Raises UnknownNameError, NoTrainedFieldError or FieldFileError.
    """
    body, field = robots.load(robot), load_field(field_file(what))
    name = what if what in scenes.names() else Path(what).stem
    source = what if what in scenes.names() else field.info.source
    return Place(name, field, scenes.load(source) if source in scenes.names() else None, body)


@lru_cache(maxsize=4)
def occupancy_of(place: Place, config: OccupancyConfig) -> OccupancyMap:
    """The map that paths are searched on; made once, for it takes longer than most searches."""
    return OccupancyMap.of(place.field, place.robot.body, config)


def field_file(what: str) -> Path:
    """The file of the field that a user means by a scene's name or a path.

    Raises UnknownNameError where it is neither, NoTrainedFieldError where the scene comes without a field.
    """
    if what in scenes.names():
        path = scenes.trained_path(what)
        if not path.is_file():
            raise NoTrainedFieldError(
                f"the scene {what!r} has no trained field yet: run `nerfnav train {what} --out {what}.npz`, "
                f"then open {what}.npz"
            )
        return path
    if not _is_path(what):
        raise UnknownNameError("scene or field file", what, scenes.names())
    return Path(what)


def _is_path(what: str) -> bool:
    """Whether the user means a file: it exists, or is written like one."""
    return Path(what).exists() or os.sep in what or bool(Path(what).suffix)
