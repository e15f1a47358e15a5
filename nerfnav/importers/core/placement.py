"""Placement: up direction, metres per unit and box of imported data, as far as they are given.

Whatever is not given is guessed, and the guess is reported.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from nerfnav.core.errors import InvalidInputError, require_positive

Vector = tuple[float, float, float]
Corners = tuple[Vector, Vector]
"""Lowest and highest corner of a box [m]."""
AXES: dict[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
"""Directions that have a name."""
OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
"""Turn of a camera from OpenCV's axes (y down, looking along z) to OpenGL's, on the right of T_world_camera."""
PLAUSIBLE = (0.5, 120.0)
"""Plausible range of the longest edge of a place for small robots [m]."""
FLATTER = 1.25
"""An up axis is doubted where the place is higher along it than along another by this factor, and more."""
LOWER = 0.03
"""And where the middle of what is there lies lower along the other axis, by this share of its height."""
_ABOUT = {"up": ("up is", "up:"), "scale": ("lengths", "scale:", "this place would be"), "box": ("box:",)}
"""Beginnings of the sentences about guesses."""
UNIT_ASSUMED = "lengths: nothing says how long a unit is, so one is taken for 1 m"
"""Beginning of the sentence about an unknown unit."""
_DOWN = 1e-24
"""Squared sine of the angle between straight down and what is taken for it: its heading is lost in rounding."""


@dataclass(frozen=True)
class MeasuredDistance:
    """Two points and their true distance, which give a scale."""

    first: Vector
    """First point, in the source's own units."""
    second: Vector
    """Second point."""
    meters: float
    """True distance [m]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for equal points and impossible distances."""
        require_positive(**{"the distance": self.meters})
        if math.dist(self.first, self.second) == 0:
            raise InvalidInputError("the two points are the same: their distance gives no scale")

    @property
    def scale(self) -> float:
        """Metres in one unit of the source."""
        return self.meters / math.dist(self.first, self.second)


def require_direction(up: Vector | None) -> None:
    """Raise InvalidInputError for a vector that is given and has no direction."""
    if up is not None and not 0 < math.hypot(*up) < math.inf:
        raise InvalidInputError("up must be a direction of three finite numbers, not all of them 0")


def require_box(box: Corners | None) -> None:
    """Raise InvalidInputError for a box that is given and empty."""
    if box is not None and not all(low < high for low, high in zip(*box, strict=True)):
        raise InvalidInputError("a box is its lowest corner and then its highest corner, each number above")


@dataclass(frozen=True)
class Placement:
    """Up direction, scale and box of the source; None: guess."""

    up: Vector | None = None
    """Direction that is up, in the source's own axes."""
    scale: float | None = None
    """Metres in one unit of the source."""
    picked: MeasuredDistance | None = None
    """Two points in the source's own units and their true distance [m]; an alternative to the scale."""
    box: Corners | None = None
    """Lowest and highest corner of the field, after scale and up [m]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for what no place can have."""
        if self.scale is not None and self.picked is not None:
            raise InvalidInputError("give either a scale or two picked points with their distance, not both")
        require_positive(**{"the scale": self.scale})
        require_direction(self.up)
        require_box(self.box)

    @property
    def meters_per_unit(self) -> float | None:
        """Metres in one unit of the source, given directly or by two points; None where it is to be guessed."""
        return self.scale if self.picked is None else self.picked.scale


def rotation_to_z(up: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """The smallest rotation that turns a direction, of any length, into the z axis.

    Rodrigues' formula about up x z, without its angle. Straight down has no smallest: it is half a turn about x.
    """
    x, y, z = up / np.linalg.norm(up)
    across = x * x + y * y
    if z < 0 and across < _DOWN:
        return np.diag([1.0, -1.0, -1.0])
    # 1 / (1 + z), which is all rounding where z is near -1; there across = (1 + z) (1 - z) has the digits
    bend = 1 / (1 + z) if z > 0 else (1 - z) / across
    return np.array([
        [1 - x * x * bend, -x * y * bend, -x],
        [-x * y * bend, 1 - y * y * bend, -y],
        [x, y, z],
    ])  # fmt: skip


def is_flatter(size: Float[np.ndarray, " 3"], own: int, other: int) -> bool:
    """True where a place is so much flatter along another axis than along its own up axis that the latter is
    doubtful."""
    return bool(size[own] > FLATTER * size[other] and size[other] <= FLATTER * size.min())


def format_length(meters: float) -> str:
    """Format a length in km, m, cm or mm."""
    for unit, name in ((1000.0, "km"), (1.0, "m"), (0.01, "cm")):
        if meters >= unit:
            return f"{meters / unit:.3g} {name}"
    return f"{1000 * meters:.3g} mm"


def direction_name(up: Float[np.ndarray, " 3"]) -> str:
    """The name of a unit vector along an axis, such as -y; the numbers of any other."""
    for name, axis in AXES.items():
        for sign, mark in ((1, ""), (-1, "-")):
            if np.allclose(up, sign * np.array(axis)):
                return mark + name
    return " ".join(f"{x:.3g}" for x in up)


def drop_answered_guesses(guesses: tuple[str, ...], known: Collection[str]) -> tuple[str, ...]:
    """Drop the sentences about guesses that are `known` by now: "up", "scale", "box"."""
    answered = tuple(words for name in known for words in _ABOUT[name])
    return tuple(guess for guess in guesses if not guess.startswith(answered))


def warn_implausible_size(longest: float) -> str | None:
    """Warning about an implausible longest edge [m] without a given scale; None where it is plausible."""
    if PLAUSIBLE[0] <= longest <= PLAUSIBLE[1]:
        return None
    return (
        f"this place would be {format_length(longest)} long: measure something (nerfnav place FILE --measure X Y Z "
        "X Y Z DISTANCE takes two points and how far they are apart in truth [m], and so does the page)"
    )
