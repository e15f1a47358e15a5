"""Query for the clearance of a plan, step by step."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import torch

from nerfnav.field import UnknownSpace
from nerfnav.planner import PlanStep, SafetyConfig, collision_per_step, measure_clearance
from nerfnav.robots import Motion
from nerfnav_app.places.derived import prepare_place
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.plan import PlanRecord
from nerfnav_app.state.session import Session


@dataclass(frozen=True)
class ClearanceQuery(Query[np.ndarray]):
    """Query for the clearance of a plan. Rows of (3, n): time [s], clearance [cm], collision bound [%]."""

    step: PlanStep = field(compare=False)
    """The last iteration of the plan."""
    unknown: UnknownSpace = field(default=UnknownSpace.OCCUPIED, compare=False)
    """Treatment of unseen space in the plan."""

    def __eq__(self, other: object) -> bool:
        """Compare plans as objects: `step` is kept, so that no other one can take its address."""
        return isinstance(other, ClearanceQuery) and self.step is other.step

    def __hash__(self) -> int:
        return hash((ClearanceQuery, id(self.step)))

    @classmethod
    def pending(cls, session: Session) -> Iterator["ClearanceQuery"]:
        """Ask for a finished plan, while no job runs."""
        plan = session.plan
        if plan is not None and plan.latest is not None and plan.outcome is not None and session.job is None:
            query = cls(plan.latest, plan.settings.unknown)
            if not query.is_answered(session):
                yield query

    @classmethod
    def rows_of(cls, plan: PlanRecord | None, session: Session) -> np.ndarray | None:
        """Return the result, if it is that of this plan."""
        asked = cls.asked_in(session)
        known = plan is not None and asked is not None and asked.step is plan.latest
        return cls.result_in(session) if known else None

    @torch.no_grad()
    def answer(self, resources: Resources) -> np.ndarray:
        """Measure the densities around the body at each step, as plans do."""
        place = prepare_place(resources.place, self.unknown)
        motion, body, config = self.step.motion, place.robot.body, SafetyConfig()
        _, reach, _ = config.lengths(place.field, body)
        bound = collision_per_step(place.field, motion, body, config.samples_per_step)
        steps = [
            Motion(motion.states[k : k + 2], motion.actions[k : k + 1], motion.dt) for k in range(len(motion.actions))
        ]
        room = [measure_clearance(place.field, step, body, config) for step in steps]
        # where nothing is within reach, the clearance is at least the reach
        clearance = np.array([reach if free is None else free for free in room])
        times = motion.dt * (1 + np.arange(len(room)))
        return np.stack([times, 100 * clearance, 100 * bound.numpy()])
