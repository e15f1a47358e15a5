"""Alignment of a place by hand: points, floor and box that the user has entered, and the commands that change them."""

import math
from dataclasses import dataclass, replace
from enum import Enum

from nerfnav.importers import AlignmentRequest, MeasuredDistance

Vector = tuple[float, float, float]


class PickTarget(Enum):
    """Measurement that clicks into the scene take; the value is the user's option."""

    DISTANCE = "two points"
    FLOOR = "the floor"

    @property
    def count(self) -> int:
        """Number of points that it takes."""
        return 2 if self is PickTarget.DISTANCE else 3


@dataclass(frozen=True)
class Ray:
    """Ray of a click into the scene."""

    origin: Vector
    """[m]"""
    direction: Vector
    """Of any length."""


@dataclass(frozen=True)
class AlignmentDraft:
    """Corrections of up, scale and box in the place's present coordinates, as far as the user has entered them."""

    pointing: PickTarget | None = None
    """Measurement that the next click takes; None: clicks measure nothing."""
    clicked: Ray | None = None
    """A click whose target is being computed."""
    measured: tuple[Vector, ...] = ()
    """Up to two points [m]."""
    distance: float | None = None
    """True distance of the two points [m]."""
    floor: tuple[Vector, ...] = ()
    """Up to three points on the floor [m]."""
    above: Vector | None = None
    """Eye of the last click on the floor: it lies above the floor."""
    find_floor: bool = False
    """Detect the floor instead."""
    kept: tuple[Vector, Vector] | None = None
    """Lowest and highest corner of the part to keep [m]; None: all."""
    undo: tuple[str, ...] = ()
    """Earlier fields, the newest last."""
    changes: tuple[str, ...] = ()
    """Description of the last alignment that was applied."""

    def pointed(self, point: Vector) -> "AlignmentDraft":
        """Add a point of the current measurement; after its last point, clicks measure nothing again."""
        assert self.pointing is not None, "only requested clicks measure something"
        known = self.measured if self.pointing is PickTarget.DISTANCE else self.floor
        points = (*known, point)[-self.pointing.count :] if len(known) < self.pointing.count else (point,)
        rest = None if len(points) == self.pointing.count else self.pointing
        if self.pointing is PickTarget.DISTANCE:
            return replace(self, measured=points, pointing=rest)
        above = self.above if self.clicked is None else self.clicked.origin
        return replace(self, floor=points, above=above, find_floor=False, pointing=rest)

    @property
    def length(self) -> float | None:
        """Present distance of the two points [m]."""
        return math.dist(*self.measured) if len(self.measured) == 2 else None

    def request(self) -> AlignmentRequest:
        """Build the request of the importers. Raises InvalidInputError for contradictory input."""
        up = None
        floor = (self.floor[0], self.floor[1], self.floor[2]) if len(self.floor) == 3 else None
        if floor is not None and self.above is not None:
            x, y, z = (eye - sum(side) / 3 for eye, side in zip(self.above, zip(*floor, strict=True), strict=True))
            up = (x, y, z)
        measured = None
        if len(self.measured) == 2 and self.distance is not None:
            measured = MeasuredDistance(*self.measured, self.distance)
        return AlignmentRequest(measured, floor=floor, find_floor=self.find_floor, up=up, kept=self.kept)


@dataclass(frozen=True)
class PickPoints:
    """Let the next clicks into the scene take a measurement, from its first point on; None: clicks measure nothing."""

    pointing: PickTarget | None


@dataclass(frozen=True)
class SetDistance:
    """Set the true distance of the two points."""

    distance: float
    """[m]"""


@dataclass(frozen=True)
class FindFloor:
    """Switch the detection of the floor on or off."""

    on: bool


@dataclass(frozen=True)
class Keep:
    """Set the part of the place to keep; None: all."""

    box: tuple[Vector, Vector] | None


@dataclass(frozen=True)
class ApplyAlignment:
    """Align the place by all that was entered."""


@dataclass(frozen=True)
class DiscardAlignment:
    """Discard all that was entered and not applied."""


@dataclass(frozen=True)
class UndoAlignment:
    """Return to the place before the last alignment."""


AlignmentAction = PickPoints | SetDistance | FindFloor | Keep | ApplyAlignment | DiscardAlignment | UndoAlignment
