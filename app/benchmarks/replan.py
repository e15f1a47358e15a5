"""The rest of a plan after a push: 250 iterations of Adam in plain torch against the fast planner."""

import statistics
import time

import torch

from nerfnav.core.steps import run_steps, yield_result
from nerfnav.experiments import Arena
from nerfnav.planner import (
    FastPlanConfig,
    OccupancyMap,
    PlanConfig,
    PlanProblem,
    PlanSteps,
    plan_fast,
    replan,
    replan_from,
)
from nerfnav.planner.solvers.warm_start import shift_warm_start
from nerfnav.robots import Motion
from nerfnav_app.benchmarks.comparison import Comparison, both_threads, time_interleaved
from nerfnav_app.benchmarks.plan import problems_of

_KICK_M, _KICK_RAD = 0.02, 0.02
"""How a robot is pushed in one step, as in the paper: 2 cm, 0.02 rad; half of that on the rates."""


def measure(
    arena: Arena, tasks: int = 10, rounds: int = 1, fast_per_round: int = 5, iterations: int = 250
) -> Comparison:
    """Push a robot off its plan after the first step and plan the rest again, on the arena's first tasks.

    `paper_ms` is the time of 250 iterations. The detail has the median time ratio to the same J (the time that the
    fast planner takes to come as low as Adam has come) and the worst ratio of the final J.
    """
    generator = torch.Generator().manual_seed(0)
    with both_threads() as used:
        pushed = [disturbed_plan(problem, generator) for problem in problems_of(arena, tasks)]
        occupancy = OccupancyMap.of(arena.field, pushed[0][0].robot.body)
        found = [_compare(*one, occupancy, (rounds, fast_per_round, iterations)) for one in pushed]
    slow_ms, fast_ms, same_ms, ratios = zip(*found, strict=True)
    detail = {
        "max_j_ratio": max(ratios),
        "median_ratio": statistics.median(slow / fast for slow, fast in zip(slow_ms, fast_ms, strict=True)),
        "same_j_ms": statistics.median(same_ms),
        "same_j_ratio": statistics.median(slow / same for slow, same in zip(slow_ms, same_ms, strict=True)),
    }
    return Comparison("replan", statistics.median(slow_ms), statistics.median(fast_ms), used, detail)


def disturbed_plan(problem: PlanProblem, generator: torch.Generator) -> tuple[PlanProblem, Motion]:
    """Plan so far, and the problem that is left after a step that ended elsewhere."""
    motion = run_steps(plan_fast(problem)).motion
    scale = torch.tensor([_KICK_M] * 3 + [_KICK_M / 2] * 3 + [_KICK_RAD] * 3 + [_KICK_RAD / 2] * 3)
    start = motion.states[1].retract(scale * torch.randn(12, generator=generator))
    return PlanProblem(problem.field, problem.robot, start, problem.goal, problem.steps - 1, problem.dt), motion


def _compare(
    problem: PlanProblem, motion: Motion, occupancy: OccupancyMap, effort: tuple[int, int, int]
) -> tuple[float, float, float, float]:
    """Times of Adam, of the fast planner, and of the latter to the J of the former [ms], and the ratio of their J."""
    rounds, per_round, iterations = effort
    paper = PlanConfig(iterations=iterations)
    config = FastPlanConfig(weights=paper.weights)

    def fast_steps() -> PlanSteps:
        return replan_from(problem, motion, 1, config, occupancy)

    def adam_steps() -> PlanSteps:
        trajectory = shift_warm_start(motion, problem.start, problem.goal, problem.robot, steps=problem.steps)
        return replan(problem, trajectory, paper)

    slow_ms, fast_ms, slow, fast = time_interleaved(
        lambda: run_steps(adam_steps()), lambda: run_steps(fast_steps()), rounds, per_round
    )
    same_ms = statistics.median(_until(fast_steps(), slow.cost.total) for _ in range(per_round))
    return slow_ms, fast_ms, same_ms, fast.cost.total / slow.cost.total


def _until(steps: PlanSteps, total: float) -> float:
    """Time of a planner [ms] until its J is at most `total`; all of its time where it ends above."""
    begun = time.perf_counter()
    for step in yield_result(steps):
        if step.cost.total <= total:
            break
    return 1e3 * (time.perf_counter() - begun)
