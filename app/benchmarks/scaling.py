"""Scaling: the cost of an iteration of the fast planner by size of motion and body, and the cost of more starts."""

import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from nerfnav.core.steps import run_steps
from nerfnav.experiments import Arena
from nerfnav.experiments.figures import COLORS, bars, panels
from nerfnav.planner import (
    FastPlanConfig,
    InitialGuess,
    Objective,
    OccupancyMap,
    PlanProblem,
    SearchConfig,
    first_guess,
    plan_fast,
)
from nerfnav.robots import Quadrotor, QuadrotorConfig
from nerfnav_app.benchmarks.comparison import both_threads, median_ms
from nerfnav_app.benchmarks.plan import problems_of

if TYPE_CHECKING:
    import matplotlib.figure


@dataclass(frozen=True)
class Scaling:
    """Times of the fast planner on one machine."""

    waypoints: np.ndarray
    """(n) time steps of the motions."""
    body_points: np.ndarray
    """(n) points of the bodies."""
    iteration_ms: np.ndarray
    """(n) time of J and its gradient [ms]."""
    one_start_ms: float
    """Median time of plans from the best way alone [ms]."""
    all_starts_ms: float
    """Median time of plans from `starts` first guesses [ms]."""
    starts: int
    """How many first guesses are compared."""
    threads: int
    """Threads that the planner had."""

    @property
    def linearity(self) -> float:
        """Share of the variance of the times that a straight line in waypoints x body points explains (R squared)."""
        return float(np.corrcoef(self.waypoints * self.body_points, self.iteration_ms)[0, 1] ** 2)


def measure(arena: Arena, repeats: int = 30, tasks: int = 10) -> Scaling:
    """Time single iterations over sizes, on the first task, and whole plans on the first tasks."""
    with both_threads() as used:
        problems = problems_of(arena, tasks)
        sizes = list(itertools.product((10, 20, 40, 80), ((3, 3, 2), (5, 5, 2), (7, 7, 3), (10, 10, 4))))
        rows = [(steps, *_iteration(problems[0], steps, counts, repeats)) for steps, counts in sizes]
        occupancy = OccupancyMap.of(arena.field, problems[0].robot.body)
        many, one = FastPlanConfig(), FastPlanConfig(search=SearchConfig.single())
        times = [
            [median_ms(lambda: run_steps(plan_fast(problem, config, occupancy)), 3) for problem in problems]  # noqa: B023
            for config in (one, many)
        ]
    steps, points, spent = (np.array(column) for column in zip(*rows, strict=True))
    starts = len(many.search.roundings) + many.search.ways - 1 + many.search.straight
    return Scaling(steps, points, spent, float(np.median(times[0])), float(np.median(times[1])), starts, used)


def picture(scaling: Scaling) -> "matplotlib.figure.Figure":
    """Time of an iteration against its size, and of plans from one start and from many."""
    figure, (iterations, starts) = panels(("An iteration", "A plan"))
    size = scaling.waypoints * scaling.body_points
    for index, count in enumerate(np.unique(scaling.body_points)):
        of = scaling.body_points == count
        iterations.plot(size[of], scaling.iteration_ms[of], "o-", color=COLORS[index % len(COLORS)], label=f"{count}")
    iterations.set_xlabel("waypoints x body points")
    iterations.set_ylabel("ms")
    iterations.legend(title="body points", fontsize=8, frameon=False)
    bars(starts, {"1 start": scaling.one_start_ms, f"{scaling.starts} starts": scaling.all_starts_ms}, "ms")
    return figure


def _iteration(
    problem: PlanProblem, steps: int, counts: tuple[int, int, int], repeats: int
) -> tuple[int, float]:
    """Number of body points, and median time of J and its gradient on the straight way [ms]."""
    robot = Quadrotor(QuadrotorConfig(point_counts=counts))
    sized = replace(problem, robot=robot, steps=steps, dt=2.0 / steps)
    guess = first_guess(sized, InitialGuess.STRAIGHT, FastPlanConfig().occupancy).trajectories[0]
    objective = Objective(sized.context(FastPlanConfig().weights), sized.route, sized.terms)
    free = guess.free.double().numpy()
    return len(robot.body.points_body), median_ms(lambda: objective(free), repeats)
