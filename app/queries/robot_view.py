"""Query for renderings of the field from the robot's camera."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from nerfnav.navigation import NavigationStep
from nerfnav.robots import RigidState
from nerfnav_app.jobs.fly.simulated_world import render_view
from nerfnav_app.places.ends import End
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.session import Session

RobotView = tuple[np.ndarray, ...]
"""One picture for each state, (height, width, 3), sRGB bytes."""


@dataclass(frozen=True)
class RobotViewQuery(Query[RobotView]):
    """Query for renderings of the field from the believed state, or from the ends."""

    reads_field: ClassVar[bool] = True
    key: tuple[Any, ...]
    """Key of the view; two queries of one key have the same answer."""
    states: tuple[RigidState | End, ...] = field(compare=False)
    """States of the camera; ends are not converted yet, for that takes long, and sessions are asked often."""
    rough: bool = False
    """Whether to render a ninth of the pixels: in flight the next step waits for it."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["RobotViewQuery"]:
        """Ask from the belief of the time step that is shown; without a flight, from start and goal."""
        if session.track is not None:
            return  # which brings its own pictures
        flight, ends = session.shown_flight, session.ends
        if flight is not None and flight.steps:
            key = ("flight", session.jobs_begun, session.runs.asked, len(flight.steps))
            yield cls(key, (flight.steps[-1].belief.mean,), _is_flying(session))
        else:
            yield cls(("ends", ends), (ends.start, ends.goal))

    @property
    def pause(self) -> float:
        """Pause so that pictures take a twentieth of the time of a flight."""
        return 19.0 if self.rough else 0.0

    def answer(self, resources: Resources) -> RobotView:
        """Render the field from each of them."""
        states = (from_.state() if isinstance(from_, End) else from_ for from_ in self.states)
        return tuple(render_view(resources.place, state, self.rough) for state in states)

    def step_of(self, flight: FlightRecord | None) -> NavigationStep | None:
        """Find the time step of the flight that the view belongs to."""
        kind, *key = self.key
        if kind != "flight" or flight is None or not 0 < key[-1] <= len(flight.steps):
            return None
        return flight.steps[key[-1] - 1]


def _is_flying(session: Session) -> bool:
    """Check whether a flight is under way and not paused."""
    return session.in_flight and session.job is not None and not session.job.paused
