"""What the page draws of the place and of a flight: one choice for everyone who looks."""

import math
from dataclasses import dataclass, replace
from enum import Enum

from nerfnav.errors import InvalidInputError

_LARGEST_ELLIPSOID = 10.0


class Backdrop(Enum):
    """What stands for the field; the value is what the user reads."""

    SURFACE = "surface"
    RENDER = "the field itself"
    SPLATS = "splats"
    NOTHING = "nothing"


@dataclass(frozen=True)
class ViewSettings:
    """What is drawn."""

    backdrop: Backdrop = Backdrop.SURFACE
    """What stands for the field."""
    opacity: float = 1.0
    """Of the surface, 0 to 1."""
    clip: float = 1.0
    """Share of the place's height up to which the surface is drawn."""
    truth: bool = False
    """Whether the ground-truth mesh is drawn too."""
    occupied: bool = False
    """Whether voxels are drawn in which the robot does not fit."""
    unknown: bool = False
    """Whether space is drawn that no camera ever saw."""
    slice: float | None = None
    """Share of the place's height at which a slice through the density is drawn; None draws none."""
    ellipsoid: float = 1.0
    """How much larger than the 95 % region covariance ellipsoids and attitude cones are drawn."""

    def where(self, splats: bool) -> "ViewSettings":
        """The look at a place that opens: its splats, where it was made of some, until something else is asked for."""
        if splats:
            return replace(self, backdrop=Backdrop.SPLATS)
        return replace(self, backdrop=Backdrop.SURFACE) if self.backdrop is Backdrop.SPLATS else self

    def check(self) -> None:
        """Raise InvalidInputError for numbers that nothing can be drawn with; a browser can send anything."""
        shares = {"opacity": self.opacity, "clip": self.clip, "slice": self.slice or 0.0}
        for name, value in shares.items():
            if not (math.isfinite(value) and 0 <= value <= 1):
                raise InvalidInputError(f"{name} must be from 0 to 1")
        if not (math.isfinite(self.ellipsoid) and 0 < self.ellipsoid <= _LARGEST_ELLIPSOID):
            raise InvalidInputError(f"ellipsoids are drawn up to {_LARGEST_ELLIPSOID:g} times as large")


@dataclass(frozen=True)
class Eye:
    """From where somebody looks at the page's scene."""

    position: tuple[float, float, float]
    """In the world [m]."""
    wxyz: tuple[float, float, float, float]
    """Attitude of the camera in the world: x right, y down, z forward."""
    fov: float
    """Vertical field of view [rad]."""
    aspect: float
    """Width over height."""

    @property
    def is_sound(self) -> bool:
        """Whether a camera can be there; a browser can send anything."""
        numbers = (*self.position, *self.wxyz, self.fov, self.aspect)
        turned = math.hypot(*self.wxyz)
        return all(map(math.isfinite, numbers)) and turned > 0 and 0.01 < self.fov < 3.1 and 0.05 < self.aspect < 20
