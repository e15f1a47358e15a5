"""Between the session and a flight that is under way: where it shall go now, and which gusts it has yet to feel."""

from app.ends import Ends, Which
from app.flying import GUST
from app.session import Job, Session
from nerfnav.navigation.orders import Orders


class Helm:
    """Follows the session on behalf of one flight. Used by the worker's thread alone."""

    def __init__(self, job: Job) -> None:
        self._job, self._ends = job.id, job.ends
        self._asked, self._felt = job.gusts, job.gusts

    def follow(self, session: Session) -> None:
        """Take what the session wants of the flight; a goal counts once the robot is known to fit there."""
        job = session.job
        if job is None or job.id != self._job:
            return
        self._asked = job.gusts
        if session.problems.get(Which.GOAL, "not known yet") is None:
            self._ends = Ends(self._ends.start, session.ends.goal)

    def orders(self) -> Orders:
        """What is asked of the next time step; a gust blows once for each time it was asked for."""
        blows = self._felt < self._asked
        self._felt += blows
        return Orders(goal=self._ends.goal.state(), gust=GUST if blows else None)
