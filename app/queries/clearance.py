"""Query for the clearance of a plan, step by step."""

from collections.abc import Iterator

import numpy as np
import torch

from nerfnav.planner import SafetyConfig, collision_per_step, measure_clearance
from nerfnav.robots import Motion
from nerfnav_app.places.derived import prepare_place
from nerfnav_app.queries.query import PlanQuery, Resources
from nerfnav_app.state.session import Session


class ClearanceQuery(PlanQuery[np.ndarray]):
    """Query for the clearance of a plan. Rows of (3, n): time [s], clearance [cm], collision bound [%]."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["ClearanceQuery"]:
        """Ask for a finished plan, while no job runs."""
        plan = session.plan
        if plan is not None and plan.latest is not None and plan.outcome is not None and session.job is None:
            yield cls(plan)

    @torch.no_grad()
    def answer(self, resources: Resources) -> np.ndarray:
        """Measure the densities around the body at each step, as plans do."""
        assert self.plan.latest is not None, "only finished plans are measured"
        place = prepare_place(resources.place, self.plan.settings.unknown)
        motion, body, config = self.plan.latest.motion, place.robot.body, SafetyConfig()
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
