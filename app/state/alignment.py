"""Alignment of a place by hand: points, floor and box that a person has given, and the actions that change them."""

import math
from dataclasses import dataclass, replace
from enum import Enum

from nerfnav.importers import AlignmentRequest, MeasuredDistance

Vector = tuple[float, float, float]


class PickTarget(Enum):
    """What clicks into the scene tell; the value is what the user reads."""

    DISTANCE = "two points"
    FLOOR = "the floor"

    @property
    def count(self) -> int:
        """How many points it takes."""
        return 2 if self is PickTarget.DISTANCE else 3


@dataclass(frozen=True)
class Ray:
    """A click into the scene."""

    origin: Vector
    """Where it begins [m]."""
    direction: Vector
    """Where it goes, of any length."""


@dataclass(frozen=True)
class AlignmentDraft:
    """How the place is to be put right, in its coordinates of now, as far as it was told."""

    pointing: PickTarget | None = None
    """What the next click tells; None: clicks are clicks."""
    clicked: Ray | None = None
    """A click whose landing is being looked for."""
    measured: tuple[Vector, ...] = ()
    """Up to two points [m]."""
    distance: float | None = None
    """How far they are apart in truth [m]."""
    floor: tuple[Vector, ...] = ()
    """Up to three points on the floor [m]."""
    above: Vector | None = None
    """From where the last of them was clicked: the floor is seen from above."""
    find_floor: bool = False
    """Whether the floor is to be looked for instead."""
    kept: tuple[Vector, Vector] | None = None
    """Lowest and highest corner of what is to be kept [m]; None: all."""
    undo: tuple[str, ...] = ()
    """Fields of before, the newest last."""
    told: tuple[str, ...] = ()
    """What the last change has changed."""

    def pointed(self, point: Vector) -> "Placing":
        """With one more point of what is being pointed at; after the last one, clicks are clicks again."""
        assert self.pointing is not None, "only clicks that were asked for land"
        known = self.measured if self.pointing is PickTarget.DISTANCE else self.floor
        points = (*known, point)[-self.pointing.count :] if len(known) < self.pointing.count else (point,)
        rest = None if len(points) == self.pointing.count else self.pointing
        if self.pointing is PickTarget.DISTANCE:
            return replace(self, measured=points, pointing=rest)
        above = self.above if self.clicked is None else self.clicked.origin
        return replace(self, floor=points, above=above, find_floor=False, pointing=rest)

    @property
    def length(self) -> float | None:
        """How far the two points are apart as the place is [m]."""
        return math.dist(*self.measured) if len(self.measured) == 2 else None

    def correction(self) -> AlignmentRequest:
        """What all this asks for. Raises InvalidInputError for what cannot be meant."""
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
    """Let the next clicks into the scene tell something, from its first point on; None: let clicks be clicks."""

    pointing: PickTarget | None


@dataclass(frozen=True)
class SetDistance:
    """Say how far the two points are apart in truth."""

    distance: float
    """[m]"""


@dataclass(frozen=True)
class FindFloor:
    """Look for the floor, or no longer."""

    on: bool


@dataclass(frozen=True)
class Keep:
    """Say what is to be kept; None: all."""

    box: tuple[Vector, Vector] | None


@dataclass(frozen=True)
class ApplyAlignment:
    """Put the place right, as it was told."""


@dataclass(frozen=True)
class DiscardAlignment:
    """Forget what was told."""


@dataclass(frozen=True)
class UndoAlignment:
    """Go back to the place as it was before the last change."""


AlignmentAction = PickPoints | SetDistance | FindFloor | Keep | ApplyAlignment | DiscardAlignment | UndoAlignment
