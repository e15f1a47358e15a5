"""A plan from scratch: A* and 2,500 iterations of Adam in plain torch against the fast planner, A* included."""

import statistics

from nerfnav import robots
from nerfnav.core.steps import run_steps
from nerfnav.experiments import Arena
from nerfnav.planner import FastPlanConfig, OccupancyMap, PlanConfig, PlanProblem, plan, plan_fast
from nerfnav_app.benchmarks.comparison import Comparison, both_threads, time_interleaved


def problems_of(arena: Arena, tasks: int) -> tuple[PlanProblem, ...]:
    """The first tasks of the arena's scene, each for the robot that it is for."""
    return tuple(
        PlanProblem(arena.field, robots.load(task.robot), task.start_state, task.goal_state)
        for task in arena.scene.tasks[:tasks]
    )


def measure(
    arena: Arena, tasks: int = 10, rounds: int = 1, fast_per_round: int = 5, iterations: int | None = None
) -> Comparison:
    """Time both on the arena's first tasks; times and the ratio are medians over the tasks.

    `iterations` of Adam replace the paper's 2,500 where a quick look will do. The detail has, for each task, the ratio
    of the times and of the final J, fast over paper, and the worst of the latter.
    """
    paper = PlanConfig.paper() if iterations is None else PlanConfig(iterations=iterations)
    problems = problems_of(arena, tasks)
    with both_threads() as used:
        found = [_compare(problem, paper, rounds, fast_per_round) for problem in problems]
    detail = {
        "max_j_ratio": max(row[2] for row in found),
        "torch_threads": 1.0,
        "median_ratio": statistics.median(slow / fast for slow, fast, _ in found),
    }
    for number, (slow, fast, ratio) in enumerate(found):
        detail |= {f"task_{number}_time_ratio": slow / fast, f"task_{number}_j_ratio": ratio}
    slow_ms, fast_ms, _ = zip(*found, strict=True)
    return Comparison("plan", statistics.median(slow_ms), statistics.median(fast_ms), used, detail)


def _compare(problem: PlanProblem, paper: PlanConfig, rounds: int, per_round: int) -> tuple[float, float, float]:
    """Times of both [ms] and the ratio of their final J."""
    occupancy = OccupancyMap.of(problem.field, problem.robot.body)
    config = FastPlanConfig(weights=paper.weights)
    slow_ms, fast_ms, slow, fast = time_interleaved(
        lambda: run_steps(plan(problem, paper, occupancy)),
        lambda: run_steps(plan_fast(problem, config, occupancy)),
        rounds,
        per_round,
    )
    return slow_ms, fast_ms, fast.cost.total / slow.cost.total
