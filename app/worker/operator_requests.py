"""Operator requests of a flight that is under way, taken from the session: its goal, gusts, kidnapping, and searches.

A kidnapped robot is moved to a free pose far away, and gets no notice of it.
"""

from dataclasses import replace

import torch

from nerfnav.field import UnknownSpace
from nerfnav.geometry import Pose
from nerfnav.navigation import OperatorRequests
from nerfnav.navigation.simulator import sample_kidnap_pose
from nerfnav.planner import fits
from nerfnav.robots import RigidState
from nerfnav_app.places.derived import prepare_place
from nerfnav_app.places.ends import EndRole
from nerfnav_app.places.place import Place
from nerfnav_app.state.flight import GUST
from nerfnav_app.state.job import Job
from nerfnav_app.state.session import Session

_ROOM = 0.03
"""Clearance of a kidnapped robot [m]."""


def find_kidnap_pose(place: Place, truth: RigidState, generator: torch.Generator) -> Pose | None:
    """Find a pose at which the robot fits, far from where it is; None where there is none."""
    planned = prepare_place(place, UnknownSpace.OCCUPIED)
    robot, body = planned.robot, planned.robot.body_with_room(_ROOM)
    return sample_kidnap_pose(
        truth, planned.field.box, lambda state: fits(planned.field, body, robot.settled(state, truth)), generator
    )


class SessionRequests:
    """Operator of one flight that follows the session. Used by the worker's thread alone."""

    def __init__(self, job: Job, place: Place) -> None:
        self._place, self._goal = place, job.ends.goal
        self._goal_state, self._truth = job.ends.goal.state(), job.ends.start.state()
        self._job = self._served = job
        self._generator = torch.Generator().manual_seed(job.id)

    def follow(self, session: Session) -> None:
        """Take the requests of the session; a goal counts once the robot is known to fit there."""
        job = session.job
        if job is None or job.id != self._job.id:
            return
        self._job = job
        if session.flight is not None and session.flight.steps:
            self._truth = session.flight.steps[-1].truth
        goal = session.ends.goal
        if goal != self._goal and session.problems.get(EndRole.GOAL, "not known yet") is None:
            self._goal, self._goal_state = goal, goal.state()

    def take(self) -> OperatorRequests:
        """Take the requests for the next time step; a gust blows once for each time that it was requested."""
        job, served = self._job, self._served
        blows, kidnaps = served.gusts < job.gusts, served.kidnaps < job.kidnaps
        self._served = replace(job, gusts=served.gusts + blows)
        return OperatorRequests(
            goal=self._goal_state,
            gust=GUST if blows else None,
            kidnap_pose=find_kidnap_pose(self._place, self._truth, self._generator) if kidnaps else None,
            search=served.searches < job.searches,
        )
