"""A place: a field that a robot can plan in, with the ground truth to judge by where there is one; how it is opened."""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import nerfnav_scenes as scenes
from nerfnav.core.errors import NerfnavError, UnknownNameError
from nerfnav.field import StoredField, load_field
from nerfnav.geometry import Camera
from nerfnav.importers import SourceKind, Splats, load_splats, source_kind, splats_path, wrong_kind_error
from nerfnav.importers.core.kinds import FIELD
from nerfnav.robots import Robot, load
from nerfnav.world import Task

if TYPE_CHECKING:
    from nerfnav.obstacles import ObstacleSet
    from nerfnav.planner import Movers
    from nerfnav.world import Scene


class NoTrainedFieldError(NerfnavError):
    """A scene whose field has not been trained yet."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Ground truth of a place, read when it is first needed: the user sees the place before."""

    tasks: tuple[Task, ...]
    """Tasks for robots there."""
    load: Callable[[], "Scene"]
    """Function that reads it; returns the same scene each time."""


@dataclass(frozen=True, eq=False)
class Place:
    """A field with its robot and its ground truth. Two places are equal only if they are the same object."""

    name: str
    """Name of the scene, or of the field's file."""
    field: StoredField
    """Field of the place."""
    truth: Truth | None
    """Ground truth of the field; None where that is unknown."""
    robot: Robot
    """Robot that moves in it."""
    splats: Splats | None = None
    """The splats that the field was made of; None where it was made of something else."""
    file: Path | None = None
    """File of the field; None where it was made in memory."""
    obstacles: "ObstacleSet | None" = None
    """Obstacles of the place; field and ground truth have those that stand. None: none."""
    bare: "Place | None" = None
    """The place without the obstacles; None where it has none."""

    @property
    def source(self) -> str | None:
        """Source that opens it again from anywhere: a bundled scene's name, else its file; None where it has none."""
        bundled = self.name in scenes.names() and self.file == scenes.trained_path(self.name)
        return self.name if bundled else str(self.file.resolve()) if self.file is not None else None

    @property
    def tasks(self) -> tuple[Task, ...]:
        """Tasks of the place; none without a ground truth."""
        return self.truth.tasks if self.truth is not None else ()

    @cached_property
    def movers(self) -> "Movers | None":
        """The obstacles beside the place, which move or are seen alone; None where there are none."""
        if self.obstacles is None or not self.obstacles.moving:
            return None
        from nerfnav.planner import Movers  # slow to import, and seldom needed

        return Movers(self.obstacles.moving)

    @cached_property
    def announced_movers(self) -> "Movers | None":
        """Those of them that are announced to planners; None where there are none."""
        if self.obstacles is None or not self.obstacles.announced:
            return None
        from nerfnav.planner import Movers  # slow to import, and seldom needed

        return Movers(self.obstacles.announced)

    @property
    def has_seen(self) -> bool:
        """Check for an obstacle that is not announced, for which a robot has to look."""
        return self.obstacles is not None and self.obstacles.has_seen

    def without_obstacles(self) -> "Place":
        """The same place as it is without the obstacles."""
        if self.bare is None or self.bare.robot is self.robot:  # the same object, by which its maps are known
            return self.bare or self
        return replace(self.bare, robot=self.robot)

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


def open_place(what: str, robot: str = "quadrotor") -> Place:
    """Open a bundled scene by name, or a field file by path.

    A field that was trained from a bundled scene finds that scene again as its ground truth, one that was trained from
    a mesh finds that beside its file; without it, nothing is judged there.
    Raises UnknownNameError, NoTrainedFieldError or FieldFileError.
    """
    path = field_file(what)
    body, field = load(robot), load_field(path)
    if what in scenes.names():
        return Place(what, field, _truth_of(what), body, file=path)
    beside = splats_path(path)
    splats = load_splats(beside) if beside.is_file() else None
    return Place(path.stem, field, ground_truth(field, path), body, splats, path)


def ground_truth(field: StoredField, path: Path) -> Truth | None:
    """Ground truth of the field in the file `path`; None where that is unknown, or no longer beside the file.

    Raises FieldFileError where what lies there is something else.
    """
    if field.info.truth:
        from nerfnav.importers.meshes.ground_truth import load_truth  # slow to import

        beside = path.with_name(Path(field.info.truth).name)
        if not beside.is_file():
            return None
        scene = load_truth(beside, field.info.truth_sha256)
        return Truth(scene.tasks, lambda: scene)
    return _truth_of(field.info.source) if field.info.source in scenes.names() else None


def _truth_of(name: str) -> Truth:
    """The ground truth of a bundled scene."""
    return Truth(scenes.tasks_of(name), lambda: scenes.load(name))


def field_file(what: str) -> Path:
    """The file of the field that a user means by a scene's name or a path.

    Raises UnknownNameError where it is neither, NoTrainedFieldError where the scene comes without a field,
    WrongKindError, which says what makes a field of it, for anything else.
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
    kind = source_kind(what)
    missing = kind is SourceKind.MISSING and Path(what).suffix in (FIELD, "")  # reading tells how to make it
    if kind is not SourceKind.FIELD and not missing:
        raise wrong_kind_error(what, kind, "a field")
    return Path(what)


def _is_path(what: str) -> bool:
    """Check for a file: it exists, or is written like one."""
    return Path(what).exists() or os.sep in what or bool(Path(what).suffix)
