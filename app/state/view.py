"""View state: what the page draws of the place, one choice for all users, and the camera of each browser tab.

Its actions come from browser tabs: a camera moved, it rests, a tab was closed. Imports nothing slow: a stored surface
is shown while all else is being imported.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from nerfnav_app.places.vantage import Point, View


class Backdrop(Enum):
    """Representation of the field; the value is the user's option."""

    SURFACE = "surface"
    RENDER = "the field itself"
    SPLATS = "splats"
    NOTHING = "nothing"


class CameraMode(Enum):
    """Camera of the scene; the value is the user's option."""

    FREE = "free"
    CHASE = "behind the robot"
    ROBOT = "the robot's own"
    TOP = "from above"


@dataclass(frozen=True)
class ViewSettings:
    """Settings of the view, the same in all tabs."""

    backdrop: Backdrop = Backdrop.SURFACE
    """Representation of the field."""
    opacity: float = 1.0
    """Of the surface, 0 to 1."""
    clip: float = 1.0
    """Share of the place's height up to which the surface is drawn."""
    truth: bool = False
    """Draw the ground-truth mesh too."""
    occupied: bool = False
    """Draw voxels in which the robot does not fit."""
    unknown: bool = False
    """Draw space that no camera saw."""
    slice: float | None = None
    """Share of the place's height at which a slice through the density is drawn; None draws none."""
    camera: CameraMode = CameraMode.FREE
    """Camera of the scene."""
    light: bool = False
    """Draw light panels."""
    plan: bool = True
    """Draw the plan, in a flight also its first plan."""
    executed: bool = True
    """Draw the executed path."""
    estimate: bool = True
    """Draw the estimate with its covariance."""
    clearance: bool = False
    """Colour the plan's line by its clearance."""
    margin: bool = True
    """Draw the room around the plan that noise asks for."""
    ellipsoid: float = 1.0
    """Scale of covariance ellipsoids and attitude cones; 1 draws the 95 % region."""

    def of_flights(self) -> "ViewSettings":
        """Keep only what counts in the drawing of a flight."""
        return ViewSettings(
            camera=self.camera, plan=self.plan, executed=self.executed, estimate=self.estimate, ellipsoid=self.ellipsoid
        )

    def for_place(self, splats: bool) -> "ViewSettings":
        """Adapt the backdrop to a place that opens: its splats, where it has some, until the user chooses another."""
        if splats:
            return replace(self, backdrop=Backdrop.SPLATS)
        return replace(self, backdrop=Backdrop.SURFACE) if self.backdrop is Backdrop.SPLATS else self


@dataclass(frozen=True)
class Eye:
    """Camera of a tab in the page's scene."""

    position: Point
    """In the world [m]."""
    wxyz: tuple[float, float, float, float]
    """Attitude of the camera in the world: x right, y down, z forward."""
    fov: float
    """Vertical field of view [rad]."""
    aspect: float
    """Width over height."""

    @property
    def is_sound(self) -> bool:
        """True where a picture can be rendered for it: a page that is folded away is a line without height."""
        return 0.01 < self.fov < 3.1 and 0.05 < self.aspect < 20


def to_point(numbers: ArrayLike) -> Point:
    """Convert three coordinates, as a browser sends them."""
    x, y, z = np.asarray(numbers, dtype=np.float64).tolist()
    return x, y, z


@dataclass(frozen=True)
class CameraMoved:
    """The camera of a tab has moved."""

    client: int
    """The tab."""
    eye: Eye


@dataclass(frozen=True)
class CameraRested:
    """A user has turned the camera, and it rests."""

    view: View


@dataclass(frozen=True)
class TabClosed:
    """A browser tab was closed."""

    client: int


TabAction = CameraMoved | CameraRested | TabClosed


@dataclass(frozen=True, kw_only=True)
class ViewState:
    """The view of the place: part of a Session."""

    view_settings: ViewSettings = field(default_factory=ViewSettings)
    """Settings of the view."""
    surface: bytes | None = None
    """The field's surface as binary glTF; None while it is being extracted."""
    surface_is_rough: bool = False
    """True until a texture is made for it."""
    view: View | None = None
    """Camera pose that sees both ends; None until it is computed: then all of the place is seen."""
    viewed: View | None = None
    """Camera pose that a user chose last; None until the camera was turned."""
    eyes: Mapping[int, Eye] = field(default_factory=dict)
    """Camera of each tab, while the page needs it."""
