"""Algorithm 1 of the paper: plan, then act, look, filter and plan again until the goal.

    plan from the start (A*, Eq. 2)
    repeat:  first action of the plan -> picture -> filter (Eqs. 3-8) -> plan from the posterior mean, hot-started
"""

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import TypeVar

import torch

from nerfnav.estimator.belief import Belief
from nerfnav.estimator.estimator import Estimator
from nerfnav.estimator.filter import FilterConfig
from nerfnav.estimator.noise import StateNoise
from nerfnav.estimator.predict import predict
from nerfnav.estimator.steps import FilterOutcome
from nerfnav.navigation.orders import Course, Orders
from nerfnav.navigation.planners import Planner
from nerfnav.navigation.recovery import Recovery, RecoveryConfig, Relocaliser, recover
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.steps import EpisodeOutcome, LoopEvent, NavigationStep
from nerfnav.planner.fast import FastPlanConfig
from nerfnav.planner.minsnap import MinSnapConfig
from nerfnav.planner.optimize import PlanConfig
from nerfnav.planner.rrt import RRTConfig
from nerfnav.planner.steps import PlanOutcome
from nerfnav.robots.state import Motion, RigidState

Step = TypeVar("Step", bound=LoopEvent)
Config = TypeVar("Config", bound=PlanConfig | FastPlanConfig | MinSnapConfig | RRTConfig)
_ROOM, _CARE = 0.04, 3.0
"""Room around the body [m] and weight of collision when a plan is redone in flight."""


@dataclass(frozen=True)
class NavigateConfig:
    """How a flight is flown."""

    plan: PlanConfig = field(default_factory=PlanConfig.paper)
    """How the first plan is made (for the paper's planner)."""
    replan: PlanConfig = field(default_factory=lambda: with_room(PlanConfig.paper_replan()))
    """How the plan is redone at each step (for the paper's planner): with 4 cm of room around the body, twice the
    2 cm by which a step is disturbed, and three times the weight of collision (paper: none, 1). With the state known
    to millimetres, 9 of 160 flights through Stonehenge then touched something; 21 with 3 cm and a weight of 1."""
    filter: FilterConfig = field(default_factory=FilterConfig)
    """How the state is estimated (for the paper's filter)."""
    noise: StateNoise = field(default_factory=StateNoise)
    """What disturbs the true robot at each step (paper: 2 cm, 0.02 rad, half on the rates)."""
    initial: StateNoise = field(default_factory=lambda: StateNoise.isotropic(0.01**2))
    """Spread of the first belief around the truth, and its covariance: 1 cm, 0.01 rad (paper: covariance 0.1 I)."""
    goal_tolerance_m: float = 0.08
    """REACHED when the believed position is this near to the goal [m]."""
    minimum_horizon: int = 6
    """Fewest steps of a plan: to meet the goal exactly in less takes wild thrust when noise has pushed the robot."""
    timeout_factor: float = 2.0
    """TIMEOUT after this many times the planned steps."""
    recovery: RecoveryConfig = field(default_factory=RecoveryConfig)
    """What is done when pictures disagree with the belief; DIVERGED when it does not help."""
    open_loop: bool = False
    """Fly the first plan blindly: no pictures, no replanning, beliefs moved by the dynamics alone."""

    @classmethod
    def paper(cls) -> "NavigateConfig":
        """The paper's assumptions: covariance 0.1 I at the start and for the process noise."""
        return cls(
            replan=PlanConfig.paper_replan(), filter=FilterConfig.paper(), initial=StateNoise.isotropic(0.1)
        )


@dataclass(frozen=True)
class Mission:
    """What is to be flown, from where the simulator stands."""

    goal: RigidState
    """Where the robot shall arrive."""
    steps: int = 20
    """Time steps of the first plan (paper: 20)."""
    dt: float = 0.1
    """Length of a time step [s] (paper: 0.1)."""
    plan: Motion | None = None
    """A first plan that is already made, from the start to the goal; None: plan now."""
    orders: Callable[[], Orders] = Orders
    """Asked at the beginning of each time step for what has changed meanwhile."""


@dataclass(frozen=True)
class Pilot:
    """Who flies."""

    planner: Planner
    """Finds the way."""
    estimator: Estimator
    """Says where the robot is."""
    relocaliser: Relocaliser | None = None
    """Finds a robot that is lost; None: lost is lost."""


@dataclass(frozen=True)
class _Flight:
    """What does not change during a flight, but for a gust of wind."""

    mission: Mission
    simulator: Simulator
    pilot: Pilot
    config: NavigateConfig
    generator: torch.Generator
    gust: StateNoise | None = None
    """Of this time step alone."""


def navigate(
    mission: Mission,
    simulator: Simulator,
    pilot: Pilot,
    config: NavigateConfig,
    generator: torch.Generator,
) -> Iterator[LoopEvent]:
    """Fly from where the simulator stands to the goal (Algorithm 1).

    Yields every iteration of planner and filter, and a NavigationStep for each time step, index 0 first; the last
    one has the outcome. A robot that touches the ground truth flies on, so that the estimate can be studied, but its
    outcome is COLLIDED whatever else happens. Raises what the planner raises for ends that cannot be planned
    between.
    """
    flight = _Flight(mission, simulator, pilot, config, generator)
    step = yield from _begin(flight)
    yield step
    touched, lost, course = False, 0, Course(mission.goal)
    while step.outcome is None:
        orders = mission.orders()
        course = course.heeding(orders, step.index)
        world = replace(flight, gust=orders.gust)
        step = yield from (_drift(step, world) if config.open_loop else _advance(step, world, course, lost))
        touched |= step.touched
        lost = lost + 1 if step.recovery is Recovery.WIDENED else 0
        outcome = EpisodeOutcome.DIVERGED if step.recovery is Recovery.LOST else _judge(step, flight, course)
        if outcome is not None and touched:
            outcome = EpisodeOutcome.COLLIDED
        step = replace(step, outcome=outcome)
        yield step


def _begin(flight: _Flight) -> Generator[LoopEvent, None, NavigationStep]:
    """Plan from the true start, which the user has chosen, then from where the robot believes to be."""
    mission, start, config = flight.mission, flight.simulator.state, flight.config
    mean = start.retract(config.initial.sample(flight.generator))
    belief = Belief(mean, config.initial.covariance())
    motion, spent_ms, outcome = mission.plan, 0.0, None
    if motion is None:
        planned, spent_ms = yield from _timed(
            flight.pilot.planner.plan(start, mission.goal, mission.steps, mission.dt)
        )
        motion = planned.motion
        if planned.outcome is PlanOutcome.NO_PATH or not _is_finite(motion):
            outcome = EpisodeOutcome.NO_PLAN
    if outcome is None and not config.open_loop:
        steps = motion.actions.shape[-2]
        planned, again_ms = yield from _timed(
            flight.pilot.planner.replan(motion, mean, mission.goal, steps, executed=0)
        )
        motion, spent_ms = planned.motion, spent_ms + again_ms
    return NavigationStep(0, 0.0, None, start, belief, None, None, motion, False, 0.0, spent_ms, outcome)


def _advance(
    last: NavigationStep, flight: _Flight, course: Course, lost: int
) -> Generator[LoopEvent, None, NavigationStep]:
    """One turn of Algorithm 1, after `lost` pictures in a row that disagreed."""
    mission, simulator, index = flight.mission, flight.simulator, last.index + 1
    action = last.plan.actions[0]
    touched = simulator.act(action, mission.dt, flight.gust)
    image = simulator.look()
    update, filter_ms = yield from _timed(
        flight.pilot.estimator.update(last.belief, image, action, mission.dt, flight.generator)
    )
    assert update.posterior is not None, "the last step of an estimator has the posterior"
    belief, recovery = update.posterior, None
    if update.outcome is FilterOutcome.DIVERGED:
        belief, recovery = yield from recover(
            belief, image, lost + 1, flight.config.recovery, flight.pilot.relocaliser
        )
    elsewhere = recovery is Recovery.RELOCALISED or course.since == last.index > 0
    left = mission.steps if elsewhere else len(last.plan.actions) - 1
    planned, replan_ms = yield from _timed(
        flight.pilot.planner.replan(
            last.plan, belief.mean, course.goal, max(left, flight.config.minimum_horizon), executed=1
        )
    )
    return NavigationStep(
        index, index * mission.dt, action, simulator.state, belief, image, update, planned.motion,
        touched, filter_ms, replan_ms, recovery=recovery, restart=planned.restart,
    )  # fmt: skip


def _drift(last: NavigationStep, flight: _Flight) -> Generator[LoopEvent, None, NavigationStep]:
    """One time step without looking: the next planned action, and a belief that only spreads."""
    yield from ()
    simulator, dt, index = flight.simulator, flight.mission.dt, last.index + 1
    action = last.plan.actions[0]
    touched = simulator.act(action, dt, flight.gust)
    belief = predict(last.belief, action, simulator.robot, dt, flight.config.filter.process_noise)
    rest = Motion(last.plan.states[1:], last.plan.actions[1:], dt)
    return NavigationStep(
        index, index * dt, action, simulator.state, belief, None, None, rest, touched, 0.0, 0.0
    )


def _judge(step: NavigationStep, flight: _Flight, course: Course) -> EpisodeOutcome | None:
    """Whether the flight is over, collisions aside."""
    mission, config = flight.mission, flight.config
    if not _is_finite(step.plan):
        return EpisodeOutcome.NO_PLAN
    if config.open_loop and len(step.plan.actions):
        return None
    if (step.belief.mean.position - course.goal.position).norm() < config.goal_tolerance_m:
        return EpisodeOutcome.REACHED
    late = step.index - course.since >= config.timeout_factor * mission.steps
    return EpisodeOutcome.TIMEOUT if late or config.open_loop else None


def _timed(steps: Iterator[Step]) -> Generator[Step, None, tuple[Step, float]]:
    """Pass all steps on; returns the last one and the time that the work took [ms], the consumer's left out."""
    spent, last = 0.0, None
    while True:
        began = perf_counter()
        step = next(steps, None)
        spent += perf_counter() - began
        if step is None:
            break
        last = step
        yield step
    assert last is not None, "lasting work yields at least one step"
    return last, 1e3 * spent


def with_room(config: Config) -> Config:
    """The same for a robot in flight, which will be pushed: see `NavigateConfig.replan`."""
    return replace(config, weights=replace(config.weights, margin=_ROOM, collision=_CARE))


def _is_finite(motion: Motion) -> bool:
    return bool(motion.states.position.isfinite().all() and motion.actions.isfinite().all())
