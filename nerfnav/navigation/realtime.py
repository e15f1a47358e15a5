"""Deadlines: time steps that pass in the world while filter and planner still compute.

A step whose filter and planner take longer than dt is late. Meanwhile the robot flies the plan before, without
pictures, and the dynamics alone move its belief; each of these time steps counts. Then the late plan goes on from
the believed state.

`measure_time` measures the work of a generator, without that of its consumer between the steps.
"""

import math
from collections.abc import Callable, Generator, Iterator
from time import perf_counter

from nerfnav.core.steps import Result, Step, run_steps
from nerfnav.navigation.episode import NavigationStep
from nerfnav.navigation.fallback import come_to_rest
from nerfnav.navigation.flight import FlightContext
from nerfnav.navigation.supervisor import SupervisorConfig
from nerfnav.robots import Motion, RigidState, Robot


def measure_time(
    steps: Generator[Step, None, Result], clock: Callable[[], float] = perf_counter
) -> Generator[Step, None, tuple[Result, float]]:
    """Pass all steps on; return the result, and the time of the work [ms] by a clock [s]."""
    spent = 0.0
    while True:
        began = clock()
        try:
            step = next(steps)
        except StopIteration as end:
            return end.value, 1e3 * (spent + clock() - began)
        spent += clock() - began
        yield step


def fly_missed_steps(before: Motion, late: NavigationStep, flight: FlightContext) -> Iterator[NavigationStep]:
    """Fly the time steps that began while a `late` one was computed; the last one has its plan.

    `before` is the plan that was flown when the picture of the late step was taken, from that time on.
    """
    belief, simulator, dt = late.filter_belief, flight.simulator, late.plan.dt
    count = count_missed(late.filter_ms + late.replan_ms, dt)
    for ahead in range(1, count + 1):
        flown = advance_plan(before, ahead - 1, belief.mean, simulator.robot)
        touched = simulator.follow(flown, believed=belief.mean)
        update = flight.stack.estimator.update(belief, None, flown.actions[0], dt, flight.generator)
        belief = run_steps(update).posterior
        plan = late.plan if ahead == count else before
        yield NavigationStep(
            late.index + ahead, (late.index + ahead) * dt, flown.actions[0], simulator.state,
            flight.stack.map_error.beside(belief), None, None, advance_plan(plan, ahead, belief.mean, simulator.robot),
            touched, 0.0, 0.0, recovery=late.recovery, late=True, apparent=belief,
            consistency=late.consistency,
        )  # fmt: skip


def count_missed(spent_ms: float, dt: float) -> int:
    """Count the time steps of `dt` [s] that begin within a time [ms], without the first one, for which it is."""
    return max(0, math.ceil(spent_ms / (1e3 * dt) - 1e-9) - 1)


def advance_plan(plan: Motion, steps: int, believed: RigidState, robot: Robot) -> Motion:
    """Return the rest of a plan some time steps later; where nothing is left, the robot comes to rest."""
    if steps < len(plan.actions):
        return plan.left_after(steps)
    return come_to_rest(robot, believed, SupervisorConfig.rest, plan.dt)
