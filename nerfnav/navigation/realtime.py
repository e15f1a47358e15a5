"""Deadlines: time steps that pass in the world while filter and planner still compute.

A step whose filter and planner take longer than dt is late. Meanwhile the robot does what was planned before, without
looking, and its belief is moved on without a picture; what it does is counted step by step. Then the late plan
goes on from where it is by then.

`measure_time` measures how long a generator's work takes, without what its consumer does between the steps.
"""


import math
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import Any, TypeVar

import torch

from nerfnav.core.steps import run_steps
from nerfnav.estimator import ConsiderCovariance, Estimator
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.steps import NavigationStep
from nerfnav.navigation.supervisor import SupervisorConfig, come_to_rest
from nerfnav.robots import Motion, RigidState, Robot

Step = TypeVar("Step")


def measure_time(
    steps: Iterator[Step], clock: Callable[[], float] = perf_counter
) -> Generator[Step, None, tuple[Any, float]]:
    """Pass all steps on; returns the result, else the last step, and the time of the work [ms] by a clock [s]."""
    spent, last = 0.0, None
    while True:
        began = clock()
        try:
            last = next(steps)
        except StopIteration as end:
            spent += clock() - began
            return last if end.value is None else end.value, 1e3 * spent
        spent += clock() - began
        yield last


Clock = Callable[[], float]
"""Seconds since any time."""


@dataclass(frozen=True)
class Overrun:
    """A step that was late, in the world that did not wait for it."""

    step: NavigationStep
    """What took so long."""
    before: Motion
    """The plan that was being flown when its picture was taken, from that time on."""
    simulator: Simulator
    """The world."""
    estimator: Estimator
    """Moves the belief on, without pictures."""
    generator: torch.Generator
    """Its draws."""
    lasting: ConsiderCovariance
    """What is told of its beliefs besides."""

    @property
    def missed(self) -> int:
        """Time steps that began meanwhile."""
        return missed(self.step.filter_ms + self.step.replan_ms, self.step.plan.dt)

    def steps(self) -> Iterator[NavigationStep]:
        """The time steps that were missed, in each of which the robot flies blind; the last one has the late plan."""
        belief, robot, dt = self.step.followed, self.simulator.robot, self.step.plan.dt
        for late in range(1, self.missed + 1):
            flown = advance_plan(self.before, late - 1, belief.mean, robot)
            touched = self.simulator.follow(flown, believed=belief.mean)
            belief = run_steps(self.estimator.update(belief, None, flown.actions[0], dt, self.generator)).posterior
            made = self.step.plan if late == self.missed else self.before
            index = self.step.index + late
            yield NavigationStep(
                index, index * dt, flown.actions[0], self.simulator.state, self.lasting.beside(belief), None, None,
                advance_plan(made, late, belief.mean, robot), touched, 0.0, 0.0, recovery=self.step.recovery, late=True,
                apparent=belief,
            )  # fmt: skip


def missed(spent_ms: float, dt: float) -> int:
    """Time steps of `dt` [s] that begin within a time [ms], the first one, which it is meant for, left out."""
    return max(0, math.ceil(spent_ms / (1e3 * dt) - 1e-9) - 1)


def advance_plan(plan: Motion, steps: int, believed: RigidState, robot: Robot) -> Motion:
    """What is left of a plan some time steps later; where nothing is, the robot comes to rest."""
    if steps < len(plan.actions):
        return plan.left_after(steps)
    return come_to_rest(robot, believed, SupervisorConfig.rest, plan.dt)
