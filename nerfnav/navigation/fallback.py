"""Fallback trajectory: beside the plan, a way to come to rest in free space, flown when the plan is no longer safe.

Each candidate brakes to a wanted velocity and then to rest: straight on, upwards, and away from what is near (down
the slope of the collision map). It is judged as plans are, by Eq. 1 on the field that planners see, where unproven
space is solid; it counts as safe when no point of the body is as likely as not to be hit and it ends at rest where
the body fits. (As SUPER does on point clouds: Ren et al., "Safety-assured high-speed navigation for MAVs", Science
Robotics, 2025.)

`build_safe_planner` makes the planner of a disturbed robot, and the safety filter that keeps a fallback ready.
"""


import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field import Field
from nerfnav.planner import (
    NEAR_CERTAIN,
    CollisionMap,
    CostTerm,
    CostWeights,
    FieldPlanner,
    OccupancyMap,
    Planner,
    PlannerConfig,
    PlannerEntry,
    PlanOutcome,
    PlanProblem,
    PlanResult,
    RiskContext,
    collision_probability_bound,
    fits,
)
from nerfnav.planner.terms.risk import RISK
from nerfnav.robots import PAPER_NOISE, Motion, NoiseModel, RigidState, Robot, StateNoise

_NO_GOOD = (
    PlanOutcome.IN_COLLISION, PlanOutcome.LIKELY_COLLISION, PlanOutcome.NO_PATH, PlanOutcome.DIVERGED,
)  # fmt: skip
"""Outcomes of plans for which a backup is flown."""


@dataclass(frozen=True)
class FallbackConfig:
    """How a robot would come to rest."""

    steps: int = 10
    """Time steps in which it has to."""
    evading: int = 4
    """Of these, the first ones in which it evades."""
    speed: float = 0.4
    """With which it evades [m/s]."""
    resting: float = 0.1
    """Speed below which it counts as at rest [m/s]."""


@dataclass(frozen=True)
class FallbackTrajectory:
    """A way to come to rest."""

    motion: Motion
    """From where the robot believes to be."""
    bound: float
    """Upper bound of the probability that it collides, by Eq. 1."""
    safe: bool
    """Whether it ends at rest where the body fits, and a collision on the way is less likely than not."""


@dataclass(frozen=True)
class SafetyFilter:
    """What keeps a backup ready."""

    field: Field
    """Where, as planners see it."""
    robot: Robot
    """Who."""
    noise: NoiseModel = PAPER_NOISE
    """Noise of the flight."""
    config: FallbackConfig = dataclasses.field(default_factory=FallbackConfig)
    """How."""

    def beside(self, planned: PlanResult, dt: float) -> tuple[FallbackTrajectory, bool]:
        """The backup from where a plan starts, and whether it is to be flown: it is safe, and the plan is not.

        Beside a good plan it is to brake straight on; evading is tried where the plan is no longer good.
        """
        start = planned.trajectory.start
        best = self._judged(self._braking(start, torch.zeros_like(start.velocity), dt))
        if planned.outcome not in _NO_GOOD:
            return best, False
        for wanted in () if best.safe else self._ways_out(start, dt):
            found = self._judged(self._braking(start, wanted, dt))
            best = max(best, found, key=lambda backup: (backup.safe, -backup.bound))
            if best.safe:
                break
        return best, best.safe and best.bound < self._bound(planned.motion)

    def hits_expected(self, motion: Motion) -> float:
        """Collisions to be expected of noise along a plan."""
        states = motion.states
        problem = PlanProblem(
            self.field, self.robot, states[0], states[-1], len(motion.actions), motion.dt, noise=self.noise
        )
        with torch.no_grad():
            return RISK.value(problem.context(CostWeights(risk=1.0)), motion).item()

    def _bound(self, motion: Motion) -> float:
        finite = motion.states.position.isfinite().all()
        return collision_probability_bound(self.field, motion, self.robot.body) if finite else 1.0

    def _ways_out(self, start: RigidState, dt: float) -> Iterator[Float[Tensor, "3"]]:
        """Velocities [m/s] with which it may evade; what costs time is made only when it is asked for."""
        if not self.robot.planar:
            yield torch.zeros_like(start.velocity).index_fill(0, torch.tensor(2), self.config.speed)
        slope = self._slope(start, dt)
        if slope.norm() > 0:
            yield -self.config.speed * slope / slope.norm()

    def _slope(self, start: RigidState, dt: float) -> Float[Tensor, "3"]:
        """Along which the chance of being pushed into something rises most."""
        height = start.position[2].item() if self.robot.planar else None
        chances = CollisionMap.of(self.field, self.robot, RiskContext(dt, self.noise, height=height))
        return torch.from_numpy(chances.gradient_at(start)).to(start.velocity)

    def _braking(self, start: RigidState, wanted: Float[Tensor, "3"], dt: float) -> Motion:
        """Brake to a velocity, for so long as the robot evades, then to rest."""
        velocities = wanted.new_zeros(self.config.steps, 3)
        velocities[: self.config.evading] = wanted
        return self.robot.roll_out_hold(start, velocities, dt, self.config.resting)

    def _judged(self, motion: Motion) -> FallbackTrajectory:
        bound, last = self._bound(motion), motion.states[-1]
        rests = bool(last.velocity.norm() < self.config.resting) and fits(self.field, self.robot.body, last)
        return FallbackTrajectory(motion, bound, rests and bound < NEAR_CERTAIN)


def build_safe_planner(
    entry: PlannerEntry,
    where: tuple[Field, OccupancyMap, Robot],
    settings: PlannerConfig,
    again: PlannerConfig | None,
    noise: StateNoise,
    terms: tuple[CostTerm, ...] | None = None,
) -> tuple[Planner, SafetyFilter | None]:
    """The planner of `entry` for the field as planners see it, its map and a robot, and what keeps a backup ready.

    The first plan counts as much risk as those `again` do (None: as the entry has them); where they count none, there
    is no backup. `noise` is what pushes the robot at each step; `terms` are what J is the sum of, None: all that
    are registered.
    """
    field, occupancy, robot = where
    again = again or entry.again(settings)
    risk, pushed = again.weights.risk, NoiseModel(noise)
    first = replace(settings, weights=replace(settings.weights, risk=risk))
    planner = entry.planner(field, robot, first, again, occupancy)
    if isinstance(planner, FieldPlanner):
        planner = replace(planner, noise=pushed, terms=planner.terms if terms is None else terms)
    return planner, SafetyFilter(field, robot, pushed) if risk else None
