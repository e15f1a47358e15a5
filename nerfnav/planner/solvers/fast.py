"""Multi-start optimisation: minimise Eq. 2 by BFGS on compiled kernels from several starts; the fast planner.

Same terms, same ends, same dynamics as adam.py; some hundred iterations of a tenth of a millisecond in place of
2,500 of several. Adam with any learning rate falls short: J at the start is nearly all control effort, whose
curvature spans many orders of magnitude, so what matters is the preconditioner (bfgs.py).

J has many minima. Several first guesses (paths around on either side, corners rounded more and less, the straight
line) are first improved with a coarse body and little weight on collision, which lets them slide past what they
graze; the best few then compete with the full J, and the winner goes on alone.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from typing import TypeVar

import numpy as np
import torch

from nerfnav.core.steps import map_steps
from nerfnav.planner.objective.objective import Evaluation, Objective
from nerfnav.planner.objective.problem import FirstGuesses, InitialGuess, PlanProblem, checked_map, paths_between
from nerfnav.planner.objective.safety import judge_search, meets_density
from nerfnav.planner.risk.costs import CostWeights, PathDensity
from nerfnav.planner.solvers.bfgs import Iterate, NewtonConfig, minimise, preconditioner
from nerfnav.planner.space.astar import SearchConfig
from nerfnav.planner.space.ends import check_finite
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import PlanOutcome, PlanStep, PlanSteps, Restart
from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots import limit_uses

Step = TypeVar("Step", bound=PlanStep)
FIRMER = (10.0, 100.0, 1000.0)
"""Factors on the weight of limits, in turn, for a plan that ends beyond them."""
_LIMITS_FIRST = 0.01
"""Share of the weight of risk in the last of these rounds: a sofa's plan through a door that noise makes risky stayed
6 % beyond its force in whatever time, and what the robot cannot do is no way to avoid a risk."""
_FINER = 4
"""Factor on the number of densities for the choice between finalists, and for a plan that meets something dense
between two way points: a body must not slip through a wall."""

_WAITS_S, _TRIES = (0.3, 0.6, 1.0, 1.5, 2.2, 3.2, 4.5, 6.4, 9.0), 3
"""Times by which plans that touch movers are made longer, in turn [s], and how many plans are made of those with which
waiting helps."""

_KEPT = 1e-6
"""Share of its scale by which a kept heading may change: too little to matter, and enough to divide by."""


@dataclass(frozen=True)
class ScoutConfig:
    """Comparison of first guesses by short searches with a coarse body."""

    points: int = 24
    """Body points at which densities are taken: a coarse body."""
    samples_per_step: int = 3
    """Densities taken along the path of each body point through a step."""
    collision: float = 0.1
    """Share of the weight of collision."""
    heat: int = 10
    """Number of steps after which only the best `survivors` go on."""
    survivors: int = 4
    """Number of first guesses that go on after `heat` steps."""
    iterations: int = 30
    """Largest number of steps."""
    finalists: int = 3
    """Number of first guesses that go on with the full J."""
    trial: int = 10
    """Number of steps with the full J after which the best goes on alone."""


@dataclass(frozen=True)
class FastPlanConfig:
    """Settings of the fast minimisation of Eq. 2."""

    newton: NewtonConfig = field(default_factory=NewtonConfig)
    """Settings of the search."""
    initial: InitialGuess = InitialGuess.ASTAR
    """Start of the search."""
    search: SearchConfig = field(default_factory=SearchConfig)
    """Paths to try."""
    scout: ScoutConfig = field(default_factory=ScoutConfig)
    """Settings of their comparison."""
    weights: CostWeights = field(default_factory=CostWeights)
    """Weights of the terms of J: by default those of the paper's planner."""
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    """Settings of the occupancy map for A*."""

    @property
    def iterations(self) -> int:
        """Return the largest number of iterations."""
        return self.newton.iterations

    @property
    def ways(self) -> SearchConfig:
        """Return the settings of the path search where risk counts: a step with a certain hit by noise costs `risk`,
        and any other about `control`, for which a robot hovers."""
        weights = self.weights
        return replace(self.search, danger=weights.risk / weights.control) if weights.control else self.search


def plan_fast(
    problem: PlanProblem, config: FastPlanConfig | None = None, occupancy: OccupancyMap | None = None
) -> PlanSteps:
    """Plan from scratch; yield every iteration with the full J, and return the best trajectory.

    J falls from one step to the next of the same `start_index`, but for the result where it must rise to keep limits.
    `occupancy` saves making the map again where the caller has it. Raises InvalidInputError, OutsideBoxError or
    OccupiedError for ends that cannot be planned between, at the first step.
    """
    config = FastPlanConfig() if config is None else config
    known = checked_map(problem, occupancy or config.occupancy)
    known = known if problem.movers is None else known.remembering()
    guesses = paths_between(problem, config.initial, known, config.ways)
    if not guesses.leads:
        return _Desk(problem, guesses.trajectories[0], config).here().end(PlanOutcome.NO_PATH)
    return (yield from improve_or_wait(problem, guesses, config, known))


def replan_fast(problem: PlanProblem, trajectory: Trajectory, config: FastPlanConfig | None = None) -> PlanSteps:
    """Improve a trajectory that is already near a good one, such as `shift_warm_start` gives."""
    check_finite("start", trajectory.start)
    config = FastPlanConfig() if config is None else config
    return (yield from improve(problem, (trajectory,), replace(config, newton=config.newton.nearby())))


def improve(
    problem: PlanProblem,
    trajectories: tuple[Trajectory, ...],
    config: FastPlanConfig,
    firmer: tuple[float, ...] = FIRMER,
) -> PlanSteps:
    """Improve trajectories between the same ends, and return the best one; yield as `plan_fast` does.

    `firmer` are the factors on the weight of limits that are tried in turn where the plan ends beyond them.
    """
    desk = _Desk(problem, trajectories[0], config)
    starts = [trajectory.free.double().numpy() for trajectory in trajectories]
    inverse = preconditioner(desk.objective.effort_curvature, starts[0], desk.scales, config.newton.prior)
    reached = desk.scout(starts, inverse)
    if len(starts) == 1:  # it may be as good as it gets already
        reached[1] = desk.objective(starts[0])
    order = sorted(reached, key=lambda index: _rank(reached[index]))[: config.scout.finalists]
    searches = {
        index: minimise(desk.objective, reached[index], desk.scales, config.newton, inverse) for index in order
    }
    latest: dict[int, Iterate] = {}
    for index in order:
        for found in islice(searches[index], config.scout.trial if len(order) > 1 else None):
            latest[index] = found
            yield desk.record(index, found.point)
    winner = order[0]
    if len(order) > 1:
        winner = min(order, key=lambda index: _rank(desk.fine(latest[index].point.free)))
    for found in searches[winner]:
        latest[winner] = found
        yield desk.record(winner, found.point)
    winning = latest[winner]
    along = desk.density_along(winning)
    best = desk.within_limits(desk.search_finely(winning) if meets_density(problem, along) else winning, firmer)
    outcome = PlanOutcome.CONVERGED if best.settled else PlanOutcome.ITERATION_LIMIT
    last = desk.record(winner, best.point)
    return last.end(judge_search(problem, last.motion, last.cost, outcome, along if best is winning else None))


def improve_or_wait(
    problem: PlanProblem, guesses: FirstGuesses, config: FastPlanConfig, occupancy: OccupancyMap
) -> PlanSteps:
    """Improve first guesses; where movers are touched, try again with more time for waiting, as far as that helps.

    Paths for more time are searched in the map. Yields as `improve` does.
    """
    found = first = yield from improve(problem, (*guesses.trajectories, *guesses.timed), config)
    tries = _TRIES if problem.movers is not None else 0
    for seconds in _WAITS_S:
        if found.outcome is not PlanOutcome.IN_COLLISION or tries == 0:
            break
        longer = replace(problem, steps=problem.steps + math.ceil(seconds / problem.dt))
        if waiting := paths_between(longer, config.initial, occupancy, config.ways).timed:
            found = yield from count_on(improve(longer, waiting, config), found.iteration + 1)
            tries -= 1
    return first if found.outcome is PlanOutcome.IN_COLLISION else found


def count_on(steps: PlanSteps, first: int, restart: Restart | None = None) -> PlanSteps:
    """Count the iterations of a planner from `first` on, and note the reason of a restart."""

    def counted(step: Step) -> Step:
        return replace(step, iteration=first + step.iteration, restart=restart)

    return counted((yield from map_steps(steps, counted)))


class _Desk:
    """Workspace of the searches between one start and one goal."""

    def __init__(self, problem: PlanProblem, trajectory: Trajectory, config: FastPlanConfig) -> None:
        route, weights, scout = trajectory.route, config.weights, config.scout
        self._flat = problem.robot.flat_map(route.start, route.goal, route.steps, route.dt)
        self._problem, self._trajectory, self._config, self._count = problem, trajectory, config, 0
        light = replace(
            weights, collision=scout.collision * weights.collision, samples_per_step=scout.samples_per_step
        )
        self._weights = weights
        self.objective = self._weighing(weights)
        self._light = self._weighing(light, scout.points)
        self.scales = problem.robot.free_scales(trajectory.free).double().numpy()
        if problem.keeps_headings:
            self.scales[problem.robot.free_headings(len(self.scales))] *= _KEPT

    @cached_property
    def _fine_weights(self) -> CostWeights:
        """Weights with so many densities that nothing is missed between them."""
        return replace(self._config.weights, samples_per_step=_FINER * self._config.weights.samples_per_step)

    @cached_property
    def fine(self) -> Objective:
        """J with so many densities."""
        return self._weighing(self._fine_weights)

    def _weighing(self, weights: CostWeights, points: int | None = None) -> Objective:
        """Make J with other weights, and with a coarser body."""
        context = replace(self._problem.context(weights), points=points)
        return Objective(context, self._trajectory.route, self._problem.counted, self._flat)

    def scout(self, starts: list[np.ndarray], inverse: np.ndarray) -> dict[int, Evaluation]:
        """Search with the coarse body; return the ends of the most promising guesses, with the full J there."""
        scout = self._config.scout
        newton = replace(self._config.newton, iterations=scout.iterations)
        searches = [minimise(self._light, self._light(free), self.scales, newton, inverse) for free in starts]
        found = {index: _last(islice(search, scout.heat)) for index, search in enumerate(searches)}
        ahead = sorted(found, key=lambda index: _rank(found[index].point))[: scout.survivors]
        return {index: self.objective(_last(searches[index], found[index]).point.free) for index in ahead}

    def density_along(self, reached: Iterate) -> PathDensity:
        """Measure the density along a plan."""
        self._flat.forward(reached.point.free)
        return PathDensity.of(self._problem.field, self._flat.motion(), self._problem.robot.body)

    def search_finely(self, reached: Iterate) -> Iterate:
        """Search on with more densities, here and in what follows: what is dense may stand between two way points."""
        self._weights, self.objective = self._fine_weights, self.fine
        return _last(minimise(self.fine, self.fine(reached.point.free), self.scales, self._config.newton))

    def within_limits(self, reached: Iterate, factors: tuple[float, ...]) -> Iterate:
        """Search on with the weight of limits times these factors, in turn, where a plan exceeds them, if that keeps
        them and touches no mover.

        Penalties end a little beyond what they bound.
        """
        tried = reached
        for firmer in (1.0, *factors):
            if firmer > 1:
                weights, free = self._weights, tried.point.free
                risk = weights.risk if firmer < FIRMER[-1] else _LIMITS_FIRST * weights.risk
                firm = self._weighing(replace(weights, limits=firmer * weights.limits, risk=risk))
                inverse = preconditioner(firm.effort_curvature, free, self.scales, self._config.newton.prior)
                tried = _last(minimise(firm, firm(free), self.scales, self._config.newton, inverse))
            self._flat.forward(tried.point.free)
            motion = self._flat.motion()
            if not any(use.violated for use in limit_uses(self._problem.robot, motion)):
                if firmer == 1 or self._problem.touches_movers(motion):
                    return reached
                return Iterate(self.objective(tried.point.free), tried.settled)
        return reached

    def record(self, index: int, reached: Evaluation) -> PlanStep:
        """Make the next step to yield."""
        self._flat.forward(reached.free)  # the search may have looked elsewhere since
        trajectory = self._trajectory.with_free(torch.from_numpy(reached.free).to(self._trajectory.free))
        self._count += 1
        return PlanStep(self._count - 1, trajectory, self._flat.motion(), reached.cost, start_index=index)

    def here(self) -> PlanStep:
        """Make a step of the trajectory as it is given."""
        return self.record(0, self.objective(self._trajectory.free.double().numpy()))


def _rank(reached: Evaluation) -> float:
    """Return J, or infinity where it is not finite."""
    total = reached.cost.total
    return total if np.isfinite(total) else np.inf


def _last(found: Iterator[Iterate], before: Iterate | None = None) -> Iterate:
    """Run a search; return its last iterate, or `before` where there is none."""
    for each in found:
        before = each
    assert before is not None, "a search yields at least its start"
    return before
