"""Time the loop's parts beside two busy processes, all on the same two cores."""

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress

import torch

from nerfnav.core.steps import run_steps
from nerfnav.experiments import Arena
from nerfnav.planner import FastPlanConfig, OccupancyMap, plan_fast, replan_from
from nerfnav_app.benchmarks.comparison import both_threads, milliseconds
from nerfnav_app.benchmarks.filter import bench_filter, situations
from nerfnav_app.benchmarks.plan import problems_of
from nerfnav_app.benchmarks.replan import disturbed_plan

PROCESSES = 2
"""Busy processes."""
_SETTLE_S = 0.3
"""Time for which they start up before anything is timed beside them [s]."""


@contextmanager
def busy_processes() -> Iterator[None]:
    """Processes that compute as long as the block lasts, on the cores of this one."""
    with ExitStack() as stack:
        for _ in range(PROCESSES):
            other = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(other.wait)
            stack.callback(other.kill)
        time.sleep(_SETTLE_S)
        yield


@contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Keep this process, and those that it starts, on so many cores, where the system can do that."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:count])
    try:
        yield
    finally:
        with suppress(OSError):  # a core may have been taken away meanwhile
            os.sched_setaffinity(0, before)


CORES = 2
"""Cores that busy processes share with what is timed."""


def measure(arena: Arena, tasks: int = 3, rounds: int = 4, per_round: int = 3) -> dict[str, dict[str, float]]:
    """Median times [ms] of a plan, a replan and an update of the filter, quiet and busy in turn, and their ratio.

    Each round times all of them alone and then beside the busy processes. The first `tasks` of the arena and as many
    views are looked at.
    """
    with both_threads(), on_cores(CORES):
        calls = {name: [*kind] for name, kind in _calls(arena, tasks).items()}
        for one in (call for kind in calls.values() for call in kind):
            one()  # compiled, and all maps made
        quiet: dict[str, list[float]] = {name: [] for name in calls}
        busy: dict[str, list[float]] = {name: [] for name in calls}
        for _ in range(rounds):
            _time(calls, per_round, quiet)
            with busy_processes():
                _time(calls, per_round, busy)
    medians = {name: (statistics.median(quiet[name]), statistics.median(busy[name])) for name in calls}
    return {
        name: {"quiet_ms": alone, "busy_ms": beside, "ratio": beside / alone}
        for name, (alone, beside) in medians.items()
    }


def _calls(arena: Arena, tasks: int) -> dict[str, list[Callable[[], object]]]:
    """Timed work."""
    problems, config = problems_of(arena, tasks), FastPlanConfig()
    occupancy = OccupancyMap.of(arena.field, problems[0].robot.body)
    generator = torch.Generator().manual_seed(0)
    pushed = [disturbed_plan(problem, generator) for problem in problems]
    fast = bench_filter(arena)
    return {
        "plan": [lambda p=problem: run_steps(plan_fast(p, config, occupancy)) for problem in problems],
        "replan": [
            lambda p=rest, m=motion: run_steps(replan_from(p, m, 1, config, occupancy)) for rest, motion in pushed
        ],
        "filter": [lambda s=now: s.updated(fast) for now in situations(arena, tasks)],
    }


def _time(calls: Mapping[str, list[Callable[[], object]]], times: int, into: Mapping[str, list[float]]) -> None:
    for name, kind in calls.items():
        for call in kind:
            into[name].extend(milliseconds(call) for _ in range(times))
