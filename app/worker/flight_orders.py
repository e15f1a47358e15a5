"""Between the session and a flight that is under way: where it shall go now, and what it has yet to endure."""

from dataclasses import replace

import torch

from nerfnav.navigation import Orders
from nerfnav_app.places.ends import Which
from nerfnav_app.places.place import Place
from nerfnav_app.state.job import Job
from nerfnav_app.state.session import Session
from nerfnav_app.state.settings import GUST
from nerfnav_app.worker.carrying import elsewhere


class FlightOrders:
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
        if goal != self._goal and session.problems.get(Which.GOAL, "not known yet") is None:
            self._goal, self._goal_state = goal, goal.state()

    def orders(self) -> Orders:
        """What is asked of the next time step; a gust blows once for each time it was asked for."""
        asked, felt = self._asked, self._felt
        blows = felt.gusts < asked.gusts
        self._felt = replace(asked, gusts=felt.gusts + blows)
        return Orders(
            goal=self._goal_state,
            gust=GUST if blows else None,
            carried=elsewhere(self._place, self._truth, self._generator) if asked.kidnaps > felt.kidnaps else None,
            search=asked.searches > felt.searches,
        )
