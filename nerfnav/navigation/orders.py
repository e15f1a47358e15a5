"""What may change while a robot flies: where it is to arrive, and what disturbs it."""

from dataclasses import dataclass, replace

import torch

from nerfnav.estimator import StateNoise
from nerfnav.geometry import Pose
from nerfnav.planner import PlanStep
from nerfnav.robots import RigidState


@dataclass(frozen=True)
class Orders:
    """What is asked of the flight for its next time step."""

    goal: RigidState | None = None
    """Where it shall arrive from now on; None: where it is going already."""
    gust: StateNoise | None = None
    """A disturbance that comes on top of the usual one in this time step."""
    carried: Pose | None = None
    """T_world_body at which a hand puts the robot down at the end of this time step, before it looks."""
    search: bool = False
    """Whether to look for the robot everywhere in the picture of this time step, even if nothing seems wrong."""


@dataclass(frozen=True)
class Course:
    """Where a flight is going."""

    goal: RigidState
    """Where it shall arrive."""
    since: int = 0
    """The time step at which this became the goal."""
    end: RigidState | None = None
    """Where plans lead: there, with a heading in which something is seen; None: with the heading that it is told."""
    keeps_headings: bool = False
    """Whether plans keep the headings of those before, which were chosen for what they show."""

    def heeding(self, orders: Orders, index: int) -> "Course":
        """The course after orders that came at time step `index`."""
        goal = orders.goal
        if goal is None or _same(goal, self.goal):
            return self
        return replace(self, goal=goal, since=index, end=None, keeps_headings=False)

    @property
    def leads_to(self) -> RigidState:
        """Where the next plan leads."""
        return self.end or self.goal

    def after(self, planned: PlanStep) -> "Course":
        """The course after a plan, which has kept its headings unless it was made anew."""
        return replace(self, keeps_headings=self.keeps_headings and planned.restart is None)


def _same(one: RigidState, other: RigidState) -> bool:
    return torch.equal(one.position, other.position) and torch.equal(one.rotation, other.rotation)
