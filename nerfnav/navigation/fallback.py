"""Fallback trajectory: comes to rest in free space beside each plan, and is flown when the plan is no longer safe.

Each candidate brakes to a target velocity and then to rest: straight on, upwards, and away from obstacles (down the
slope of the collision map). It is judged as plans are, by Eq. 1 on the field that planners see, where unproven space
is solid; it is safe when a collision is less likely than not and it ends at rest where the body fits. (As SUPER does
on point clouds: Ren et al., "Safety-assured high-speed navigation for MAVs", Science Robotics, 2025.) Where movers
touch all of them, the one that they touch last is flown in place of a plan that they touch, too.

`build_safe_planner` makes the planner of a disturbed robot, and the safety filter that keeps a fallback ready.
`come_to_rest` is the trajectory of a robot that does not know its position, and therefore no free space.
"""

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import Field
from nerfnav.planner import (
    NEAR_CERTAIN,
    CollisionMap,
    CostTerm,
    CostWeights,
    FieldPlanner,
    Movers,
    OccupancyMap,
    Planner,
    PlannerConfig,
    PlannerEntry,
    PlanOutcome,
    PlanProblem,
    PlanResult,
    RiskContext,
    collision_probability,
    collision_probability_bound,
    fits,
)
from nerfnav.planner.risk.collision_map import cached_c_space
from nerfnav.planner.terms.risk import RISK
from nerfnav.robots import PAPER_NOISE, Motion, NoiseModel, RigidState, Robot

_RESTING_S = 1.0
"""Time after a motion in which movers must not touch the robot that rests at its end [s]."""
_UNSAFE = (
    PlanOutcome.IN_COLLISION, PlanOutcome.LIKELY_COLLISION, PlanOutcome.NO_PATH, PlanOutcome.DIVERGED,
)  # fmt: skip
"""Outcomes of plans in place of which the fallback is flown."""


@dataclass(frozen=True)
class FallbackConfig:
    """Shape of a fallback trajectory."""

    steps: int = 10
    """Its time steps."""
    evading: int = 4
    """Of these, the first ones in which it evades."""
    speed: float = 0.4
    """Speed of the evasion [m/s]."""
    fast: float = 1.0
    """Speed of evasions from movers, where slower ones are touched [m/s]."""
    resting: float = 0.1
    """Speed below which the robot counts as at rest [m/s]."""


@dataclass(frozen=True)
class FallbackTrajectory:
    """A trajectory that comes to rest, and its risk."""

    motion: Motion
    """The trajectory, from the start of the plan beside it."""
    bound: float
    """Upper bound of the probability that it collides, by Eq. 1."""
    safe: bool
    """Whether it ends at rest where the body fits, and a collision on the way is less likely than not."""
    touched_s: float = math.inf
    """Time until it touches a mover [s]; infinity where it does not."""
    hits: bool = False
    """True: a collision with what stands is as likely as not."""


@dataclass(frozen=True)
class SafetyFilter:
    """Safety filter: keeps a fallback trajectory ready, and rejects plans that are less safe."""

    field: Field
    """The field as planners see it."""
    robot: Robot
    """The robot that flies."""
    noise: NoiseModel = PAPER_NOISE
    """Noise of its motion."""
    config: FallbackConfig = dataclasses.field(default_factory=FallbackConfig)
    """Shape of fallback trajectories."""
    movers: Movers | None = None
    """Announced obstacles that move; None: all stands."""

    def make_fallback(self, planned: PlanResult, dt: float, time: float = 0.0) -> FallbackTrajectory:
        """Make the fallback from the start of a plan, at a time of the flight [s]: straight braking; evasion where both
        are unsafe."""
        start = planned.trajectory.start
        best = self._judge(self._brake(start, torch.zeros_like(start.velocity), dt), time)
        if planned.outcome in _UNSAFE and not best.safe:
            for velocity in self._evasions(start, dt):
                found = self._judge(self._brake(start, velocity, dt), time)
                best = max(best, found, key=lambda each: (each.safe, not each.hits, -each.bound, each.touched_s))
                if best.safe:
                    break
        return best

    def rejects(self, planned: PlanResult, fallback: FallbackTrajectory, time: float = 0.0) -> bool:
        """Check whether the fallback is flown in place of a plan from a time of the flight [s] on: it is safe, and the
        plan is not; or movers touch both, and nothing that stands is in the fallback's way."""
        if planned.outcome not in _UNSAFE:
            return False
        if fallback.safe:
            return fallback.bound < self._bound(planned.motion, time)
        return self.touched_s(planned.motion, time) < math.inf and not fallback.hits

    def touched_s(self, motion: Motion, time: float) -> float:
        """Return the time until a motion from a time of the flight [s] on touches a mover, or is touched soon after its
        end [s]; infinity where it is not."""
        if self.movers is None or not motion.states.position.isfinite().all():
            return math.inf
        waits = motion.states[-1:][torch.zeros(1 + math.ceil(_RESTING_S / motion.dt), dtype=torch.long)]
        states = RigidState.cat([motion.states, waits])
        touched = self.movers.least_gaps(states, motion.dt, self.robot.body, time) <= 0
        return motion.dt * int(touched.argmax()) if touched.any() else math.inf

    def collision_probability(self, motion: Motion, tolerance: float = 0.0, time: float = 0.0) -> float:
        """Estimate the probability that a flight by a plan, from a time of the flight [s] on, touches something before
        it is within `tolerance` [m] of the end of the plan."""
        return collision_probability(
            self.field, self.robot, motion, self.noise, tolerance, movers=self.movers, time=time
        )

    def expected_collisions(self, motion: Motion) -> float:
        """Compute the expected number of collisions by noise along a plan, as J counts them: each step anew."""
        states = motion.states
        problem = PlanProblem(
            self.field, self.robot, states[0], states[-1], len(motion.actions), motion.dt, noise=self.noise
        )
        with torch.no_grad():
            return RISK.value(problem.context(CostWeights(risk=1.0)), motion).item()

    def clearance(self, path: Float[Tensor, "n 3"], most: float) -> float:
        """Measure the clearance of a level body along places [m]: the distance of its centre from the nearest place
        where it does not fit, at most `most` [m].

        0 on the ground, where a body stands on what it may touch.
        """
        if self.robot.planar:
            return 0.0
        return cached_c_space(self.field, self.robot, None).clearance(path.double().numpy(), most)

    def blocks(self, places: Float[Tensor, "*batch 3"]) -> Bool[Tensor, "*batch"]:
        """Check whether the body of a robot that flies, taken level, does not fit at places [m], or is outside of the
        box."""
        return torch.from_numpy(cached_c_space(self.field, self.robot, None).blocks(places.double().numpy()))

    def _bound(self, motion: Motion, time: float) -> float:
        if not motion.states.position.isfinite().all() or self.touched_s(motion, time) < math.inf:
            return 1.0
        return collision_probability_bound(self.field, motion, self.robot.body)

    def _evasions(self, start: RigidState, dt: float) -> Iterator[Float[Tensor, "3"]]:
        """Velocities [m/s] of evasions, the cheapest to compute first."""
        if not self.robot.planar:
            yield torch.zeros_like(start.velocity).index_fill(0, torch.tensor(2), self.config.speed)
        slope = self._slope(start, dt)
        if slope.norm() > 0:
            yield -self.config.speed * slope / slope.norm()
        if self.movers is not None:
            for speed in (self.config.speed, self.config.fast):
                for x, y in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)):
                    yield speed * slope.new_tensor([x, y, 0.0])

    def _slope(self, start: RigidState, dt: float) -> Float[Tensor, "3"]:
        """Direction in which the chance of a collision by noise rises most."""
        height = start.position[2].item() if self.robot.planar else None
        chances = CollisionMap.of(self.field, self.robot, RiskContext(dt, self.noise, height=height))
        return torch.from_numpy(chances.gradient_at(start)).to(start.velocity)

    def _brake(self, start: RigidState, velocity: Float[Tensor, "3"], dt: float) -> Motion:
        """Brake to a velocity for the steps of the evasion, then to rest."""
        velocities = velocity.new_zeros(self.config.steps, 3)
        velocities[: self.config.evading] = velocity
        return self.robot.roll_out_hold(start, velocities, dt, self.config.resting)

    def _judge(self, motion: Motion, time: float) -> FallbackTrajectory:
        touched_s, last, standing = self.touched_s(motion, time), motion.states[-1], 1.0
        if motion.states.position.isfinite().all():
            standing = collision_probability_bound(self.field, motion, self.robot.body)
        bound = standing if touched_s == math.inf else 1.0
        rests = bool(last.velocity.norm() < self.config.resting) and fits(self.field, self.robot.body, last)
        return FallbackTrajectory(motion, bound, rests and bound < NEAR_CERTAIN, touched_s, standing >= NEAR_CERTAIN)


def build_safe_planner(
    entry: PlannerEntry,
    field: Field,
    occupancy: OccupancyMap,
    robot: Robot,
    settings: PlannerConfig,
    noise: NoiseModel,
    again: PlannerConfig | None = None,
    terms: tuple[CostTerm, ...] | None = None,
    movers: Movers | None = None,
) -> tuple[Planner, SafetyFilter | None]:
    """Build the planner of a registry entry for a disturbed robot, and its safety filter.

    `field` is that which planners see, `occupancy` its map. The first plan weighs risk as the settings `again` of
    later plans do (None: those of the entry); where they do not weigh it, there is no safety filter. `noise` is that of
    its flights (expected_noise.py); `terms` sum to J, None: all that are registered. Raises InvalidInputError for
    movers where the planner knows none.
    """
    again = again or entry.again(settings)
    risk = again.weights.risk
    planner = entry.planner(field, robot, entry.first_in_flight(settings, again), again, occupancy)
    if isinstance(planner, FieldPlanner):
        planner = replace(planner, noise=noise, terms=planner.terms if terms is None else terms, movers=movers)
    if movers is not None and not entry.avoids_movers:
        raise InvalidInputError(
            f"the planner {entry.name!r} knows no obstacles that move: take the planner 'fast', or leave their motions "
            "out"
        )
    return planner, SafetyFilter(field, robot, noise, movers=movers) if risk else None


def come_to_rest(
    robot: Robot,
    start: RigidState,
    steps: int,
    dt: float,
    yaw_rate: Callable[[RigidState], float] | None = None,
    velocity: Float[Tensor, "3"] | None = None,
) -> Motion:
    """Brake in `steps` steps of `dt` [s] and stay, turning with a yaw rate [rad/s] that depends on the state; with a
    `velocity` [m/s], brake to that."""
    states, actions = [start], []
    for _ in range(steps):
        now = states[-1]
        seen = now if velocity is None else replace(now, velocity=now.velocity - velocity)
        actions.append(robot.hold(seen, dt, 0.0 if yaw_rate is None else yaw_rate(now)))
        states.append(robot.step(now, actions[-1], dt))
    return Motion(RigidState.stack(states), torch.stack(actions), dt)
