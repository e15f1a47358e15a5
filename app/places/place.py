"""A place: a field that a robot can plan in, with the ground truth to judge by where there is one."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import scenes
from nerfnav.field import StoredField
from nerfnav.geometry import Camera
from nerfnav.importers import Splats
from nerfnav.robots import Robot, load
from nerfnav.world import Task

if TYPE_CHECKING:
    from nerfnav.world import Scene


@dataclass(frozen=True, eq=False)
class Truth:
    """The ground truth of a place, which is read when it is first needed: people see the place before."""

    tasks: tuple[Task, ...]
    """What is asked of robots there."""
    load: Callable[[], "Scene"]
    """What reads it; gives the same scene each time."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where jobs happen. Two places are the same only if they are the same object."""

    name: str
    """Name of the scene, or of the field's file."""
    field: StoredField
    """What is planned in."""
    truth: Truth | None
    """What the field was trained from; None where that is unknown."""
    robot: Robot
    """What moves."""
    splats: Splats | None = None
    """The splats that the field was made of; None where it was made of something else."""
    file: Path | None = None
    """Where the field was read; None where it was made in memory."""

    @property
    def source(self) -> str | None:
        """What opens it again, wherever that is done: a bundled scene's name, else its file; None where it has none."""
        bundled = self.name in scenes.names() and self.file == scenes.trained_path(self.name)
        return self.name if bundled else str(self.file.resolve()) if self.file is not None else None

    @property
    def tasks(self) -> tuple[Task, ...]:
        """What is asked of this robot here; none without a ground truth."""
        return self.truth.tasks if self.truth is not None else ()

    def with_robot(self, name: str) -> "Place":
        """The same place for another robot. See `nerfnav.robots.load` for names, files and errors."""
        return replace(self, robot=load(name))

    def seen_with(self, camera: Camera) -> "Place":
        """The same place for a robot that sees with another camera, at the same mount."""
        return replace(self, robot=self.robot.with_camera(camera, self.robot.mount))

    @property
    def scene(self) -> "Scene | None":
        """The ground truth; None where there is none. The first time takes a moment."""
        return self.truth.load() if self.truth is not None else None
