"""What a flight is made of, and what its camera should see."""

from dataclasses import dataclass, field, replace
from functools import partial

import torch

from nerfnav.navigation.mission import Mission, NavigateConfig, Pilot
from nerfnav.navigation.orders import Course, Orders
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.supervisor import Lookout
from nerfnav.planner import fits
from nerfnav.planner.active_yaw import Watch, turned_to_see, watching
from nerfnav.planner.visibility import seeing
from nerfnav.robots import Motion, RigidState


@dataclass(frozen=True)
class Flight:
    """What does not change during a flight, but for the orders."""

    mission: Mission
    simulator: Simulator
    pilot: Pilot
    config: NavigateConfig
    generator: torch.Generator
    orders: Orders = field(default_factory=Orders)
    """Of this time step alone."""

    @property
    def lookout(self) -> Lookout:
        """What looks for the robot when it is lost."""
        return Lookout(self.pilot.relocaliser, self.config.recovery, self.simulator.mount)

    @property
    def watch(self) -> Watch | None:
        """How the camera looks at what is there; None where that does not matter, and on the ground, where it takes
        room to turn, or leads elsewhere."""
        seen, enough, guard = self.pilot.seen, self.config.in_sight, self.pilot.guard
        if seen is None or enough == 0 or self.config.open_loop or self.simulator.robot.planar:
            return None
        may_be = partial(fits, seen if guard is None else guard.field, self.simulator.robot.body)
        return Watch(seen, enough, self.simulator.mount, may_be)

    def sees(self, state: RigidState) -> tuple[float, float]:
        """How much of enough the camera should see there, and by how much to turn to see more [rad]; see sight.py."""
        watch = self.watch
        return (1.0, 0.0) if watch is None else seeing(watch.matter, state, watch.enough, watch.mount)

    def seeing(self, course: Course, here: RigidState, rest: Motion, leads: bool = True) -> tuple[Course, Motion]:
        """The course with an end in which something is seen, and what is left of a plan with headings that show more.

        `rest` begins where the robot believes to be; whether it `leads` to the goal: else that is straight ahead. A
        robot that has nothing to look for arrives as it was told.
        """
        watch = self.watch
        if watch is None:
            return replace(course, end=course.goal), rest
        way = rest.states if leads else RigidState.stack([here, course.goal])
        sights, goal = watch.sights(way), course.leads_to
        end = turned_to_see(watch, sights, (here, goal))
        turned = watching(watch, sights, rest, (here, goal, end), self.simulator.robot) if leads else None
        if turned is None:
            return replace(course, end=end, keeps_headings=False), rest
        return replace(course, end=turned.states[-1], keeps_headings=True), turned
