"""View: what the page draws of the place and of a flight, one choice for all users, and the camera of each tab.

Its actions come from the tabs of browsers: a camera has moved, it rests, a tab was closed. Imports nothing slow: a
surface that was kept is shown while all else is being imported.
"""


from dataclasses import dataclass, replace
from enum import Enum

from nerfnav_app.places.vantage import View


class Backdrop(Enum):
    """What stands for the field; the value is what the user reads."""

    SURFACE = "surface"
    RENDER = "the field itself"
    SPLATS = "splats"
    NOTHING = "nothing"


class CameraMode(Enum):
    """From where the scene is seen; the value is what the user reads."""

    FREE = "free"
    CHASE = "behind the robot"
    ROBOT = "the robot's own"
    TOP = "from above"


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
    camera: CameraMode = CameraMode.FREE
    """From where the scene is seen."""
    light: bool = False
    """Whether the panels are light."""
    clearance: bool = False
    """Whether the plan's line has the colours of its clearance."""
    ellipsoid: float = 1.0
    """How much larger than the 95 % region covariance ellipsoids and attitude cones are drawn."""

    def where(self, splats: bool) -> "ViewSettings":
        """The look at a place that opens: its splats, where it was made of some, until something else is asked for."""
        if splats:
            return replace(self, backdrop=Backdrop.SPLATS)
        return replace(self, backdrop=Backdrop.SURFACE) if self.backdrop is Backdrop.SPLATS else self


@dataclass(frozen=True)
class Eye:
    """Camera of a tab: from where it looks at the page's scene."""

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
        """Whether a picture can be rendered for it: a page that is folded away is a line without height."""
        return 0.01 < self.fov < 3.1 and 0.05 < self.aspect < 20


@dataclass(frozen=True)
class CameraMoved:
    """The camera of a tab has moved."""

    client: int
    """Which tab."""
    eye: Eye


@dataclass(frozen=True)
class CameraRested:
    """Somebody has turned the camera, and let it rest."""

    view: View


@dataclass(frozen=True)
class TabClosed:
    """A tab was closed."""

    client: int


TabAction = CameraMoved | CameraRested | TabClosed
