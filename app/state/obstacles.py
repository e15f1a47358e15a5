"""Obstacles that a user places: their entries as in a file, and the commands that change them."""

from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec

from nerfnav.core.errors import InvalidInputError
from nerfnav.obstacles import CutOut, Obstacle, ObstacleEntry, WayPointsEntry, obstacle_of, read_obstacle_entries

_THINNEST, _LONGEST = 0.005, 1000.0
"""Range of lengths of obstacles [m]."""
SPEED = 0.5
"""Speed of a new path [m/s]."""
_SLOWEST, _FASTEST = 0.01, 50.0
"""Range of speeds that the page sets [m/s]."""


class ObstacleKind(Enum):
    """Shape of a new obstacle; the value is what the user reads."""

    BOX = "box"
    SPHERE = "sphere"
    CYLINDER = "cylinder"
    BOX_VOLUME = "box volume"
    BALL_VOLUME = "ball volume"
    CLICKED_PART = "clicked part"

    @property
    def selects(self) -> bool:
        """True for volumes that select a part of the field; that of a clicked part is a box volume around it."""
        return self in (ObstacleKind.BOX_VOLUME, ObstacleKind.BALL_VOLUME, ObstacleKind.CLICKED_PART)

    def entry(self, size: float) -> dict[str, Any]:
        """Entry of a shape as wide, deep and tall as `size` [m]."""
        match self:
            case ObstacleKind.BOX | ObstacleKind.BOX_VOLUME | ObstacleKind.CLICKED_PART:
                return {"box": (size, size, size)}
            case ObstacleKind.SPHERE | ObstacleKind.BALL_VOLUME:
                return {"sphere": 0.5 * size}
            case ObstacleKind.CYLINDER:
                return {"cylinder": {"radius": 0.5 * size, "height": size}}


class PathPoint(Enum):
    """Target of clicks that draw the path of the chosen obstacle, besides ends and new obstacles."""

    NEXT = "next way point"


class GizmoMode(Enum):
    """Effect of the handles of the chosen obstacle; the value is the user's option."""

    MOVE = "Move"
    TURN = "Turn"
    SCALE = "Scale"


@dataclass(frozen=True)
class PlacedObstacle:
    """Obstacle of the page."""

    entry: ObstacleEntry = field(hash=False)
    """Its entry as in a file; its name is unique."""
    hidden: bool = False
    """True while it counts nowhere."""
    selects: bool = False
    """True for a volume that selects a part of the field, until that is separated."""

    @property
    def name(self) -> str:
        """Return the name, which no other obstacle has."""
        return self.entry.name

    @cached_property
    def obstacle(self) -> Obstacle:
        """The obstacle of the entry. Raises InvalidInputError for one that is impossible."""
        return obstacle_of(self.entry)

    @property
    def cut_out(self) -> CutOut | None:
        """The part of the field that it is; None for a solid of its own."""
        return self.obstacle.shape if isinstance(self.obstacle.shape, CutOut) else None

    def changed(self, **parts: Any) -> "PlacedObstacle":
        """Replace parts of the entry."""
        entry = msgspec.convert({**msgspec.to_builtins(self.entry), **parts}, ObstacleEntry)
        return replace(self, entry=entry)

    @property
    def moves(self) -> bool:
        """True for an obstacle that has a motion."""
        return self.entry.motion is not None

    @property
    def path(self) -> WayPointsEntry | None:
        """The way points along which it moves; None where it stands or moves otherwise."""
        return None if self.entry.motion is None else self.entry.motion.way_points

    @property
    def may_have_path(self) -> bool:
        """True for an obstacle whose path can be drawn: parts of the field stand, and motions of a file stay."""
        return not self.selects and self.entry.cut_out is None and (self.path is not None or not self.moves)

    def with_way_point(self, point: tuple[float, float, float]) -> "PlacedObstacle":
        """Add a way point [m] to the path, which begins where the obstacle stands at take-off."""
        x, y, z = (round(there - here, 4) for there, here in zip(point, self.entry.position, strict=True))
        path = self.path
        points = [(0.0, 0.0, 0.0)] if path is None else path.points
        speed, closed = (SPEED, True) if path is None else (path.speed, path.closed)
        return self._along([*points, (x, y, z)], speed, closed)

    def with_pace(self, speed: float, closed: bool) -> "PlacedObstacle":
        """Set the speed of the path [m/s], and whether it is closed. Raises InvalidInputError for absurd speeds."""
        if not _SLOWEST <= speed <= _FASTEST:
            raise InvalidInputError(f"the speed of a path is from {_SLOWEST:g} to {_FASTEST:g} m/s, not {speed:g}")
        return self if self.path is None else self._along(self.path.points, speed, closed)

    def _along(self, points: list[tuple[float, float, float]], speed: float, closed: bool) -> "PlacedObstacle":
        return self.changed(motion={"way_points": {"points": points, "speed": speed, "closed": closed}})

    def separated(self, name: str) -> "PlacedObstacle":
        """Make an obstacle of the part of the field in this volume."""
        entry, pose = self.entry, {"position": self.entry.position, "rotation": self.entry.rotation}
        volume = {"box": entry.box, "sphere": entry.sphere, **pose}
        return PlacedObstacle(msgspec.convert({"name": name, "cut_out": volume, **pose}, ObstacleEntry))

    @property
    def half_extents(self) -> tuple[float, float, float] | None:
        """Half edges of the box around it in its own axes [m]; None for shapes that cannot be scaled."""
        entry = self.entry
        if entry.box is not None:
            x, y, z = (0.5 * edge for edge in entry.box)
            return x, y, z
        if entry.sphere is not None:
            return entry.sphere, entry.sphere, entry.sphere
        if entry.cylinder is not None:
            return entry.cylinder.radius, entry.cylinder.radius, 0.5 * entry.cylinder.height
        return None

    def scaled(self, half: tuple[float, float, float]) -> "PlacedObstacle":
        """Set the half edges of the box around it [m]; a sphere and a cylinder take the edge that changed most."""
        before = self.half_extents
        if before is None:
            return self
        x, y, z = (min(max(abs(edge), 0.5 * _THINNEST), 0.5 * _LONGEST) for edge in half)
        entry = self.entry
        if entry.box is not None:
            return self.changed(box=(2 * x, 2 * y, 2 * z))
        if entry.sphere is not None:
            return self.changed(sphere=max((x, y, z), key=lambda edge: abs(edge - before[0])))
        radius = max((x, y), key=lambda edge: abs(edge - before[0]))
        return self.changed(cylinder={"radius": radius, "height": 2 * z})


@dataclass(frozen=True)
class ChooseObstacle:
    """Choose the obstacle whose handles are shown."""

    name: str | None
    """The obstacle; None chooses none."""


@dataclass(frozen=True)
class ChooseMode:
    """Choose what the handles of the chosen obstacle do."""

    mode: GizmoMode


@dataclass(frozen=True)
class ChangeObstacle:
    """Move, turn or scale an obstacle, hide or rename it."""

    name: str
    """The obstacle."""
    changed: PlacedObstacle
    """The obstacle as it is from now on."""
    held: bool = False
    """True while the user still drags it."""


@dataclass(frozen=True)
class CopyObstacle:
    """Place a copy of an obstacle beside it."""

    name: str


@dataclass(frozen=True)
class DeleteObstacle:
    """Take an obstacle away."""

    name: str


@dataclass(frozen=True)
class SeparateObstacle:
    """Make an obstacle of the part of the field in a volume."""

    name: str
    """The volume."""


@dataclass(frozen=True)
class ChangePace:
    """Change how an obstacle moves along its way points."""

    name: str
    """The obstacle."""
    speed: float
    """[m/s]"""
    closed: bool
    """The first way point follows the last one, without end."""


@dataclass(frozen=True)
class RemoveMotion:
    """Let an obstacle stand."""

    name: str


@dataclass(frozen=True)
class PlayMotions:
    """Move all obstacles from take-off on, or put them back."""

    on: bool


ObstacleAction = (
    ChooseObstacle
    | ChooseMode
    | ChangeObstacle
    | CopyObstacle
    | DeleteObstacle
    | SeparateObstacle
    | ChangePace
    | RemoveMotion
    | PlayMotions
)


@dataclass(frozen=True, kw_only=True)
class ObstacleState:
    """Obstacles that the user has placed: part of a Session."""

    obstacles: tuple[PlacedObstacle, ...] = ()
    """All of them, hidden ones too."""
    chosen: str | None = None
    """Name of the obstacle whose handles are shown."""
    gizmo_mode: GizmoMode = GizmoMode.MOVE
    """Effect of its handles."""
    in_hand: str | None = None
    """Name of the obstacle that the user drags, while anything is held."""
    motion_time: float | None = None
    """Time at which obstacles are shown while their motions are played [s]; None while they are not."""

    @property
    def movers(self) -> tuple[PlacedObstacle, ...]:
        """The obstacles that are not hidden, and move."""
        return tuple(each for each in self.visible_obstacles if each.moves)

    @property
    def chosen_obstacle(self) -> PlacedObstacle | None:
        """The obstacle whose handles are shown."""
        return self.obstacle_named(self.chosen)

    @property
    def visible_obstacles(self) -> tuple[PlacedObstacle, ...]:
        """The obstacles that are not hidden, without volumes that only select."""
        return tuple(each for each in self.obstacles if not (each.hidden or each.selects))

    def obstacle_named(self, name: str | None) -> PlacedObstacle | None:
        """Find an obstacle by its name; None where there is none."""
        return next((each for each in self.obstacles if each.name == name), None)


def read_placed(file: Path) -> tuple[PlacedObstacle, ...]:
    """Read the obstacles of a file. Raises InvalidInputError where it cannot be read."""
    return tuple(map(PlacedObstacle, read_obstacle_entries(file)))


def free_name(obstacles: tuple[PlacedObstacle, ...], kind: str) -> str:
    """Find the first name "kind 1", "kind 2", ... that no obstacle has."""
    taken = {each.name for each in obstacles}
    return next(name for number in range(1, len(taken) + 2) if (name := f"{kind} {number}") not in taken)


def new_obstacle(kind: ObstacleKind, name: str, size: float, position: tuple[float, float, float]) -> PlacedObstacle:
    """Make an obstacle as wide, deep and tall as `size` [m]."""
    entry = msgspec.convert({"name": name, "position": position, **kind.entry(size)}, ObstacleEntry)
    return PlacedObstacle(entry, selects=kind.selects)
