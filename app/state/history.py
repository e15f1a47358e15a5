"""Undo history: what a person has asked for before each move and each setting.

`SavedSession` is such a moment on disk: a place is found in it again when a server opens it the next time.
"""


from collections.abc import Hashable
from dataclasses import dataclass

from nerfnav_app.places.ends import Ends
from nerfnav_app.places.vantage import View
from nerfnav_app.state.settings import Choice, FlightSettings, PlanSettings
from nerfnav_app.state.view import ViewSettings

MOST = 100
"""So many steps can be undone."""


@dataclass(frozen=True)
class Moment:
    """What a person has asked for at one time, as far as that can be undone."""

    choice: Choice
    task: str | None
    home: str | None
    """The task that was chosen last."""
    home_ends: Ends | None
    """The ends that were found for the robot, where no task is home."""
    ends: Ends
    plan_settings: PlanSettings
    flight_settings: FlightSettings
    view_settings: ViewSettings


@dataclass(frozen=True)
class History:
    """Moments to go back to and ahead to, the nearest last."""

    past: tuple[Moment, ...] = ()
    future: tuple[Moment, ...] = ()
    last: Hashable = None
    """What the last step has changed: a hand that moves on makes no further step."""

    def stepped(self, before: Moment, what: Hashable) -> "History":
        """After `what` has changed since the moment `before`."""
        if what is not None and what == self.last and self.past:
            return History(self.past, (), what)
        return History((*self.past, before)[-MOST:], (), what)


@dataclass(frozen=True)
class SavedSession:
    """How a place was left."""

    moment: Moment
    """What was asked for."""
    view: View | None = None
    """From where it was looked at; None where nobody has turned the camera."""
