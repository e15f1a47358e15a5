"""Query: what is the plan between the ends as they are now, with what is set now? So it follows the hand."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from nerfnav.planner import planners
from nerfnav.robots import Motion
from nerfnav_app.places.ends import Ends
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.queries.wanted_plan import WantedPlan, drafted, plan_request, planned
from nerfnav_app.state.records import PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.state.settings import Choice, PlanSettings


@dataclass(frozen=True)
class FollowingPlanQuery(Query[WantedPlan]):
    """What is the plan between these ends, by this planner with these settings?"""

    ends: Ends
    choice: Choice
    settings: PlanSettings
    draft: bool = False
    """Whether a hand still moves an end: then it is made as quickly as can be, without a verdict."""
    jobs_begun: int = field(default=0, compare=False)
    """How many jobs there were when it was asked."""
    last: Motion | None = field(default=None, compare=False)
    """The plan that was shown then: a draft begins with it."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["FollowingPlanQuery"]:
        """Where a plan is not the one that is wanted now, and the planner is quick enough."""
        plan = session.plan
        if plan is None or session.job is not None or session.flight_is_shown:
            return
        wanted = session.plan_is_stale or (plan.draft and not session.held)
        if wanted and planners.load(session.choice.planner).real_time:
            last = None if plan.latest is None else plan.latest.motion
            asked = session.ends, session.choice, session.plan_settings
            yield cls(*asked, session.held, session.jobs_begun, last)

    def answer(self, resources: Resources) -> WantedPlan:
        """Plan as the job does, or as quickly as can be."""
        own = resources.plan_configs.get(self.choice.planner)
        request = plan_request(self.settings, self.ends, self.choice.planner, own)
        return drafted(request, resources.place, self.last) if self.draft else planned(request, resources.place)

    def apply(self, session: Session, result: WantedPlan) -> Session:
        """The session with the plan, unless a job has begun since or another robot was taken.

        The ends may have moved on meanwhile: what was found for earlier ones is newer than what is shown.
        """
        plan, robot = session.plan, session.choice.robot
        if plan is None or session.jobs_begun != self.jobs_begun or robot != self.choice.robot:
            return session
        if not result.steps:
            return replace(session, plan=replace(plan, refusal=result.refusal))
        record = PlanRecord(
            self.ends, self.choice.planner, self.settings, draft=self.draft, summary=result.summary
        )
        for step in result.steps:
            record = record.with_step(step)
        return replace(session, plan=record)
