"""Stand-ins for planner and estimator that take microseconds, so that the loop itself is tested."""

from dataclasses import dataclass, field

import torch
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_step import FilterOutcome, FilterResult, FilterStep, FilterUpdate
from nerfnav.estimator.core.prediction import predict
from nerfnav.navigation.flight import FlightRequest
from nerfnav.navigation.simulator import Simulator
from nerfnav.planner.solvers.warm_start import shift_warm_start
from nerfnav.planner.steps import PlanCost, PlanOutcome, PlanResult, PlanStep, PlanSteps
from nerfnav.planner.trajectory import Route, Trajectory
from nerfnav.robots import StateNoise
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.state import Motion, RigidState

ROBOT = Quadrotor()
START, GOAL = RigidState.at_rest((-0.4, 0.0, 0.3)), RigidState.at_rest((0.4, 0.1, 0.3))
REQUEST = FlightRequest(GOAL, steps=12)
CALM = StateNoise(0.002, 0.001, 0.002, 0.001)
COST = PlanCost(0.0, 1.0, 0.0)


def draws(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def grey(pose: object) -> Tensor:
    return torch.full((4, 6, 3), 100, dtype=torch.uint8)


def simulator(**parts: object) -> Simulator:
    """A robot at START that sees grey in a calm world, unless given other parts."""
    defaults: dict[str, object] = {"camera": grey, "generator": draws(0), "noise": CALM}
    return Simulator(ROBOT, START, **(defaults | parts))  # type: ignore[arg-type]


@dataclass
class StraightPlanner:
    """Straight lines; remembers what it was asked."""

    outcome: PlanOutcome = PlanOutcome.CONVERGED
    broken: bool = False
    starts: list[RigidState] = field(default_factory=list)
    horizons: list[int] = field(default_factory=list)

    def plan(self, route: Route) -> PlanSteps:
        start, goal, steps, dt = route.start, route.goal, route.steps, route.dt
        share = torch.linspace(0, 1, steps + 1)[:, None]
        share = share**3 * (10 - 15 * share + 6 * share.square())
        positions = start.position + share * (goal.position - start.position)
        free = ROBOT.encode(torch.cat([positions, torch.zeros(steps + 1, 1)], -1), start, goal, dt)
        return (yield from self._steps(Trajectory(free, route), self.outcome))

    def replan(self, last: Motion, route: Route, executed: int) -> PlanSteps:
        self.starts.append(route.start)
        self.horizons.append(route.steps)
        rest = shift_warm_start(last, route.start, route.goal, ROBOT, executed=executed, steps=route.steps)
        return (yield from self._steps(rest, PlanOutcome.CONVERGED))

    def _steps(self, trajectory: Trajectory, outcome: PlanOutcome) -> PlanSteps:
        motion = trajectory.motion(ROBOT)
        if self.broken:
            motion = motion.map(lambda tensor: tensor * torch.nan)
        yield PlanStep(0, trajectory, motion, COST)
        return PlanResult(1, trajectory, motion, COST, outcome=outcome)


@dataclass(frozen=True)
class Oracle:
    """An estimator that knows the truth, or pretends to be lost."""

    simulator: Simulator
    outcome: FilterOutcome = FilterOutcome.UPDATED

    def update(
        self, belief: Belief, image: Tensor | None, action: Tensor, dt: float, generator: torch.Generator
    ) -> FilterUpdate:
        prediction = predict(belief, action, ROBOT, dt, CALM)
        tells = self.outcome is FilterOutcome.UPDATED
        seen = Belief(self.simulator.state, CALM.covariance() if tells else prediction.covariance)
        step = FilterStep(0, seen.mean, 1.0, 1.0, torch.zeros(1, 2, dtype=torch.long), torch.zeros(1))
        yield step
        return FilterResult(seen, self.outcome, step)
