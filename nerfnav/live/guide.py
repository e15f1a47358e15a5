"""Guidance: from a belief to the next setpoints on the way to a goal, or to what else is safe.

The plan is redone from each belief by the planner of flights, with the risk that it counts there, and judged on the
field as planners see it, where unproven space is solid; so is the curve through the setpoints. A plan that is not
good is never sent: the vehicle is to brake along a fallback trajectory (navigation/fallback.py), or, where that is
not safe either, to hold.

A plan is followed for one of its steps before it is redone, unless the vehicle has strayed from it: a quadrotor's
first two accelerations are given by how it leans, and one that began anew more often would never come to lean.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import torch

from nerfnav.core.errors import NerfnavError
from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief
from nerfnav.field import Field, UnknownSpace, planning_field
from nerfnav.live.answer import Goal, Guidance, Order, Setpoint
from nerfnav.live.setpoints import place_on_curve, predict_guided, setpoints_of, shift_half_step_back
from nerfnav.navigation import NavigateConfig, SafetyFilter, build_safe_planner, estimate_flight_time, expect_noise
from nerfnav.navigation.fallback import FallbackTrajectory
from nerfnav.planner import (
    FLYABLE,
    FastPlanConfig,
    OccupancyMap,
    Planner,
    PlanOutcome,
    PlanProblem,
    PlanResult,
    PlanSteps,
    Route,
    collision_probability_bound,
    downgrade_outcome,
    fits,
    nearest_free_pose,
    planners,
    scales_of,
    with_risk,
)
from nerfnav.robots import Motion, NoiseModel, RigidState, Robot, StateNoise

_STEP = 0.9
"""Share of a step after which a plan is redone: pictures do not come exactly in time."""
_ON_THE_WAY = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of the rest of the way, at which the body must fit for ARRIVED."""
_PATIENCE = 1.5
"""Times the usual duration that a plan may take where that is over the vehicle's limits."""


@dataclass(frozen=True)
class GuideConfig:
    """Options of guidance; lengths that are None follow from its body's width w."""

    dt: float = 0.1
    """Length of a plan's step [s]; longer for large vehicles on long ways."""
    planning: FastPlanConfig = field(default_factory=FastPlanConfig)
    """How plans are made."""
    noise: StateNoise = field(default_factory=StateNoise)
    """What pushes the vehicle at each step: plans keep their distance accordingly."""
    pace: float = 2.0
    """Times the usual duration that a way may take: slow enough for pictures that come ten times a second."""
    minimum_horizon: int = NavigateConfig.minimum_horizon
    """Fewest steps of a plan."""
    arrived_m: float | None = None
    """ARRIVED when the believed position is this near to the goal [m]; None: 0.8 w."""
    arrived_mps: float = 0.3
    """And the believed speed is below this [m/s]."""
    widest_m: float | None = None
    """HOLD where a coordinate of the position has a larger standard deviation than this [m]; None: w / 4."""


@dataclass(frozen=True)
class _Course:
    """The plan that is under way."""

    goal: Goal
    motion: Motion
    arrival: float
    """When it is to end [s]."""
    guidance: Guidance
    """Answered guidance."""

    def holds(self, believed: RigidState, time: float, stray: float) -> bool:
        """Return True while its first step is under way, and the vehicle within `stray` [m] of it."""
        point = self.guidance.at(time)
        if point is None or time - self.guidance.setpoints[0].time > _STEP * self.motion.dt:
            return False
        return bool((believed.position - torch.tensor(point.position)).norm() <= stray)


class Guide:
    """Keeps one plan for one vehicle, and redoes it from each belief."""

    def __init__(self, field: Field, robot: Robot, config: GuideConfig | None = None) -> None:
        """Plan nothing yet. The map of the field is made for the first goal, or by `map_at`."""
        self.field, self.robot = planning_field(field, UnknownSpace.OCCUPIED), robot
        self._seen = field
        self.config = GuideConfig() if config is None else config
        self._course: _Course | None = None
        self._maps: dict[float | None, OccupancyMap] = {}
        self._pilots: dict[int, tuple[Planner, SafetyFilter | None]] = {}

    def map_at(self, height: float) -> OccupancyMap:
        """Return the occupancy map, at one height [m] for a planar robot; made once, which takes seconds."""
        key = height if self.robot.planar else None
        if key not in self._maps:
            self._maps[key] = OccupancyMap.of(self.field, self.robot.body, self.config.planning.occupancy, key)
        return self._maps[key]

    def nearest_free(self, state: RigidState) -> RigidState | None:
        """The nearest state to this one in which the body fits; None where there is none within reach."""
        return nearest_free_pose(self.field, self.robot.body, state, self.map_at(float(state.position[2])))

    def forget(self) -> None:
        """Give up the plan: the vehicle is not where it was."""
        self._course = None

    @torch.no_grad()
    def toward(self, goal: Goal, belief: Belief, time: float) -> Guidance:
        """Return the guidance from a belief of a time [s] to a goal."""
        end = RigidState.at_rest(goal.position, goal.yaw)
        if not all(map(math.isfinite, (*goal.position, goal.yaw))):
            return self._given_up(f"the goal {goal.position}, {goal.yaw} is made of finite numbers only")
        spread = belief.position_std
        widest = self._width / 4 if self.config.widest_m is None else self.config.widest_m
        if not spread <= widest:
            return self._given_up(f"the place is known to {100 * spread:.1f} cm, and plans need {100 * widest:.1f} cm")
        if self._is_there(belief.mean, end):
            self._course = None
            resting = Setpoint(time, goal.position, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), goal.yaw)
            return Guidance(Order.ARRIVED, "the vehicle is at its goal", (resting,), 0.0)
        last = self._course
        if last is not None and last.goal == goal and last.holds(belief.mean, time, widest):
            return last.guidance
        try:
            return self._planned(goal, belief.mean, end, time)
        except NerfnavError as error:
            return self._given_up(str(error))

    def _planned(self, goal: Goal, start: RigidState, end: RigidState, time: float) -> Guidance:
        """Plan, and return the plan if it is safe."""
        planner, guard = self._pilot(float(end.position[2]))
        last = self._course if self._course is not None and self._course.goal == goal else None
        step = run_steps(self._again(planner, last, start, end, time) if last else self._anew(planner, start, end))
        outcome = self._outcome(step)
        if outcome is PlanOutcome.OVER_LIMITS:  # the vehicle was pushed off its plan: allow more time
            last, step = None, run_steps(self._anew(planner, start, end, _PATIENCE))
            outcome = self._outcome(step)
        if outcome in FLYABLE:
            bound = collision_probability_bound(self.field, place_on_curve(step.motion), self.robot.body)
            guidance = Guidance(Order.FOLLOW, outcome.value, setpoints_of(step.motion, time), bound)
            self._course = _Course(goal, step.motion, _arrival(last, step.motion, time), guidance)
            return guidance
        self._course = None
        backup = None if guard is None else guard.make_fallback(step, step.motion.dt)
        return _stopping(outcome, backup, time)

    def _anew(self, planner: Planner, start: RigidState, end: RigidState, patience: float = 1.0) -> PlanSteps:
        """A plan from scratch that may take so many times the usual time."""
        config = self.config
        problem = PlanProblem(self.field, self.robot, self.robot.settled(start, end), end, dt=config.dt)
        occupancy = self.map_at(float(end.position[2]))
        timing = estimate_flight_time(problem, occupancy, with_risk(config.planning))
        steps = math.ceil(patience * max(config.pace * timing.steps, config.minimum_horizon, self.robot.minimum_steps))
        return planner.plan(Route(self._begun(start, end, timing.dt), end, steps, timing.dt))

    def _again(
        self, planner: Planner, last: _Course, start: RigidState, end: RigidState, time: float
    ) -> PlanSteps:
        """The rest of the last plan."""
        dt, before = last.motion.dt, len(last.motion.actions)
        left = max(0, min(before, round((last.arrival - time) / dt)))
        steps = max(left, self.config.minimum_horizon, self.robot.minimum_steps)
        leaning = None if self.robot.planar else predict_guided(last.guidance, time + 0.5 * dt, flies=True)
        route = Route(self._begun(start, end, dt, leaning), end, steps, dt)
        return planner.replan(last.motion, route, executed=before - left)

    def _begun(self, start: RigidState, end: RigidState, dt: float, leaning: RigidState | None = None) -> RigidState:
        return self.robot.settled(shift_half_step_back(start, dt, leaning), end)

    def _outcome(self, step: PlanResult) -> PlanOutcome:
        """Return the outcome of a plan, or that of the curve through its setpoints."""
        if step.outcome not in FLYABLE:
            return step.outcome
        problem = PlanProblem(self.field, self.robot, step.motion.states[0], step.motion.states[-1], dt=step.motion.dt)
        return downgrade_outcome(problem, place_on_curve(step.motion), step.outcome)

    def _pilot(self, height: float) -> tuple[Planner, SafetyFilter | None]:
        """Planner and guard of flights, with the map at a height."""
        occupancy = self.map_at(height)
        if id(occupancy) not in self._pilots:
            self._pilots[id(occupancy)] = build_safe_planner(
                planners.load("fast"), self.field, occupancy, self.robot, self.config.planning,
                self._expect_noise(occupancy),
            )
        return self._pilots[id(occupancy)]

    def _expect_noise(self, occupancy: OccupancyMap) -> NoiseModel:
        """Expect the noise of the vehicle in the place, as flights do: with what its pictures leave unknown there."""
        config = NavigateConfig(noise=self.config.noise).in_field(self._seen)
        return expect_noise(self._seen, occupancy, self.robot, config)

    def _given_up(self, reason: str) -> Guidance:
        self._course = None
        return Guidance(Order.HOLD, reason)

    def _is_there(self, believed: RigidState, end: RigidState) -> bool:
        near = 0.8 * self._width if self.config.arrived_m is None else self.config.arrived_m
        slow, apart = believed.velocity.norm() <= self.config.arrived_mps, end.position - believed.position
        if not (apart.norm() <= near and slow):
            return False
        way = [replace(end, position=believed.position + share * apart) for share in _ON_THE_WAY]
        return all(fits(self.field, self.robot.body, state) for state in way)  # else it is planned, or refused

    @cached_property
    def _width(self) -> float:
        return scales_of(self.field, self.robot.body).width


def _stopping(outcome: PlanOutcome, backup: FallbackTrajectory | None, time: float) -> Guidance:
    """Come to rest along a backup that is safe, else by whatever means the vehicle has."""
    reason = f"no safe plan is known: {outcome.value}"
    if backup is None or not backup.safe:
        return Guidance(Order.HOLD, reason)
    return Guidance(Order.BRAKE, reason, setpoints_of(backup.motion, time), backup.bound)


def _arrival(last: _Course | None, motion: Motion, time: float) -> float:
    """When the vehicle is to arrive [s]: as before, unless the plan was made anew or is as short as plans may be."""
    end = time + len(motion.actions) * motion.dt
    return end if last is None or end > last.arrival + motion.dt else last.arrival
