"""Place state: the open place, the robot in it, start and goal, and the commands that change them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from nerfnav import robots
from nerfnav.estimator import estimators
from nerfnav.importers import Corners
from nerfnav.planner import planners
from nerfnav.robots import RobotFile
from nerfnav_app.places.ends import End, EndRole, Ends, default_ends
from nerfnav_app.places.place import Place
from nerfnav_app.places.sources import USUAL, QualityName
from nerfnav_app.state.alignment import AlignmentDraft, Ray
from nerfnav_app.state.obstacles import ObstacleKind, PathPoint


@dataclass(frozen=True)
class Choice:
    """Robot, planner and estimator, by name."""

    robot: str = "quadrotor"
    """One of `nerfnav.robots.names()`, or the path of a robot's file."""
    planner: str = "fast"
    """One of `nerfnav.planner.planners.names()`."""
    estimator: str = "fast"
    """One of `nerfnav.estimator.estimators.names()`."""

    def check(self) -> None:
        """Raise UnknownNameError, which lists the known names, for an unknown one.

        Raise InvalidInputError for a robot that is impossible or does not move by itself.
        """
        robots.load(self.robot).require_planned()
        planners.load(self.planner)
        estimators.load(self.estimator)


@dataclass(frozen=True)
class MoveEnd:
    """Move the start or the goal."""

    which: EndRole
    end: End
    held: bool = False
    """True while the user still drags it."""


@dataclass(frozen=True)
class TypeEnd:
    """Move the start or the goal to typed numbers, which may lie outside of the place."""

    which: EndRole
    end: End


@dataclass(frozen=True)
class ChooseTask:
    """Take start and goal of a task of the scene."""

    name: str


@dataclass(frozen=True)
class OpenPlace:
    """Open another scene, field or source of one."""

    what: str
    """Name of a bundled scene, or path of a file or folder."""
    box: Corners | None = None
    """Box of the field that is made of a source; None: all of the source."""


@dataclass(frozen=True)
class ChooseQuality:
    """Set the training quality of places that come without a field."""

    quality: QualityName


@dataclass(frozen=True)
class ListPlaces:
    """List the library of places again: one was renamed or deleted."""


@dataclass(frozen=True)
class Choose:
    """Select another robot, planner or estimator."""

    choice: Choice


@dataclass(frozen=True)
class AimEnd:
    """Let the next click into the scene place an end or a new obstacle, or each click a way point; None: clicks place
    nothing."""

    which: EndRole | ObstacleKind | PathPoint | None


@dataclass(frozen=True)
class ClickScene:
    """Report a click into the scene."""

    ray: Ray


@dataclass(frozen=True)
class Click:
    """A click into the scene that places an end, a new obstacle or a way point."""

    which: EndRole | ObstacleKind | PathPoint
    """The end, the kind of the obstacle, or the next point of a path."""
    ray: Ray


@dataclass(frozen=True, kw_only=True)
class PlaceState:
    """The place and the ends: part of a Session."""

    choice: Choice = field(default_factory=Choice)
    """Robot, planner and estimator."""
    robot_draft: RobotFile | None = None
    """Edits of the robot that are not applied yet."""
    place: Place | None = None
    """None while it is being opened."""
    places_asked: int = 0
    """Rises when the library of places may have changed."""
    quality: QualityName = USUAL
    """Training quality of places that come without a field."""
    task: str | None = None
    """The task that start and goal belong to; None once they were moved by hand."""
    home: str | None = None
    """The task that was chosen last: a reset returns to it."""
    home_ends: Ends | None = None
    """The ends that were proposed for the robot, without a chosen task."""
    ends: Ends = field(default_factory=Ends)
    """Start and goal."""
    seeking: bool = False
    """True while ends are searched that suit the robot: the current ones do not."""
    problems: dict[EndRole, str | None] = field(default_factory=dict)
    """Reason why the robot does not fit at an end, None where it fits; absent while that is checked."""
    offers: dict[EndRole, End] = field(default_factory=dict)
    """Nearest free pose of an end at which the robot does not fit."""
    outside: Mapping[EndRole, End] = field(default_factory=dict)
    """Typed ends outside of the place: shown until they are corrected, never used."""
    held: bool = False
    """True while the user drags an end or an obstacle."""
    aiming: EndRole | ObstacleKind | PathPoint | None = None
    """The end, the kind of obstacle, or the point of a path that the next click into the scene places."""
    clicked: Click | None = None
    """A click whose target is being computed."""
    alignment: AlignmentDraft = field(default_factory=AlignmentDraft)
    """Corrections of up, scale and box that are not applied yet."""

    @property
    def first_ends(self) -> Ends | None:
        """Ends that a reset restores: of the task that was chosen last, else those that were proposed."""
        if self.place is None or self.home is None:
            return self.home_ends
        return default_ends(self.place, self.home)
