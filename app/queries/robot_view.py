"""Query: what does the field look like to the robot's camera?"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nerfnav.navigation import NavigationStep
from nerfnav.robots import RigidState
from nerfnav_app.jobs.fly.simulated_world import render_view
from nerfnav_app.places.ends import End
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.records import FlightRecord
from nerfnav_app.state.session import Session

RobotView = tuple[np.ndarray, ...]
"""One picture for each state, (height, width, 3), sRGB bytes."""


@dataclass(frozen=True)
class RobotViewQuery(Query[RobotView]):
    """What does the field look like from where the robot believes to be, or from the ends?"""

    key: tuple[Any, ...]
    """What the view is of; two queries of one key have the same answer."""
    states: tuple[RigidState | End, ...] = field(compare=False)
    """From where it looks; ends as they are, for states take long to make, and the session is often asked."""
    rough: bool = False
    """Whether a ninth of the pixels will do: in flight each step would wait for the others."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["RobotViewQuery"]:
        """From the belief of the time step that is shown; without a flight, from start and goal."""
        if session.track is not None:
            return  # which brings its own pictures
        flight, ends = session.shown_flight, session.ends
        if flight is not None and flight.steps:
            key = ("flight", session.jobs_begun, session.runs.asked, len(flight.steps))
            query = cls(key, (flight.steps[-1].belief.mean,), _goes_on(session))
        else:
            query = cls(("ends", ends), (ends.start, ends.goal))
        if not query.is_answered(session):
            yield query

    @property
    def pause(self) -> float:
        """A twentieth of the time for pictures of a flight whose next step waits for them."""
        return 19.0 if self.rough else 0.0

    def answer(self, resources: Resources) -> RobotView:
        """Render the field from each of them."""
        states = (from_.state() if isinstance(from_, End) else from_ for from_ in self.states)
        return tuple(render_view(resources.place, state, self.rough) for state in states)

    def step_of(self, flight: FlightRecord | None) -> NavigationStep | None:
        """The time step of the flight that the view is of."""
        kind, *key = self.key
        if kind != "flight" or flight is None or not 0 < key[-1] <= len(flight.steps):
            return None
        return flight.steps[key[-1] - 1]


def _goes_on(session: Session) -> bool:
    """Whether the next step of a flight waits for nobody."""
    return session.in_flight and session.job is not None and not session.job.paused
