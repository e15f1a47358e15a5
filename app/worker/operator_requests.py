"""Operator requests of a flight that is under way, taken from the session: its goal, gusts, and kidnapping.

A kidnapped robot is put down at a free pose far away, and is not informed of it.
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
from nerfnav_app.state.job import Job
from nerfnav_app.state.session import Session
from nerfnav_app.state.settings import GUST

_ROOM = 0.03
"""Around a robot that is put down somewhere else [m]."""


def find_kidnap_pose(place: Place, truth: RigidState, generator: torch.Generator) -> Pose | None:
    """A pose at which the robot fits, far from where it is; None where there is none."""
    seen = prepare_place(place, UnknownSpace.OCCUPIED)  # as plans see it
    body = seen.robot.body_with_room(_ROOM)

    def fits_there(state: RigidState) -> bool:
        return fits(seen.field, body, seen.robot.settled(state, truth))

    return sample_kidnap_pose(truth, seen.field.box, fits_there, generator)


class SessionRequests:
    """Follows the session on behalf of one flight. Used by the worker's thread alone."""

    def __init__(self, job: Job, place: Place) -> None:
        self._job, self._place = job.id, place
        self._goal, self._goal_state = job.ends.goal, job.ends.goal.state()
        self._asked = self._felt = job
        self._truth = job.ends.start.state()
        self._generator = torch.Generator().manual_seed(job.id)

    def follow(self, session: Session) -> None:
        """Take what the session wants of the flight; a goal counts once the robot is known to fit there."""
        job = session.job
        if job is None or job.id != self._job:
            return
        self._asked = job
        if session.flight is not None and session.flight.steps:
            self._truth = session.flight.steps[-1].truth
        goal = session.ends.goal
        if goal != self._goal and session.problems.get(EndRole.GOAL, "not known yet") is None:
            self._goal, self._goal_state = goal, goal.state()

    def orders(self) -> OperatorRequests:
        """What is asked of the next time step; a gust blows once for each time it was asked for."""
        asked, felt = self._asked, self._felt
        blows = felt.gusts < asked.gusts
        self._felt = replace(asked, gusts=felt.gusts + blows)
        return OperatorRequests(
            goal=self._goal_state,
            gust=GUST if blows else None,
            carried=find_kidnap_pose(self._place, self._truth, self._generator)
            if asked.kidnaps > felt.kidnaps
            else None,
            search=asked.searches > felt.searches,
        )
