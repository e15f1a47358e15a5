"""Moving obstacles: corridors of 105 m full of moving boxes, flown by planners that know the motion or do not.

Trial k of a level is the world of seed S + k. The state is known, and plans are flown without noise.

    success    arrived, touched nothing by either rule of collision (judge.py), |y| <= 6 m, z in 0.5 to 6 m
    times      CPU times of replans on one thread; in the summary the median flight's median, the worst flight's p95
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from nerfnav.experiments.arena import Arena
from nerfnav.experiments.figures import COLORS, Figure, bars, draw_distribution, panels
from nerfnav.experiments.moving.contenders import CONTENDERS
from nerfnav.experiments.moving.judge import Flown, judge_flight
from nerfnav.experiments.moving.worlds import LEVELS, make_world
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study, run_trials

_WORLDS = 10
"""Worlds of each level."""


@dataclass(frozen=True)
class Corridor:
    """Trial of the experiment: one planner in one world."""

    planner: str
    """One of CONTENDERS."""
    level: str
    """One of LEVELS."""
    seed: int
    """Of the world, and of what is random in the planner."""


def run(study: Study) -> ExperimentSteps:
    """Fly all worlds with every planner that is installed."""
    missing = {name: reason for name, entry in CONTENDERS.items() if (reason := entry.missing()) is not None}
    seeds = range(study.seed, study.seed + (study.trials or _WORLDS))
    rows: list[Row] = []
    for name in CONTENDERS:
        if name not in missing:
            trials = [Corridor(name, level, seed) for level in LEVELS for seed in seeds]
            rows += yield from run_trials(study, f"flying by {name}", fly, trials)
    return Results(summarize(rows, missing), tuple(rows), {"moving": partial(draw_figure, rows)}, ("planner", "level"))


def fly(_: Arena, trial: Corridor) -> Row:
    """Fly one world with one planner, and judge the flight."""
    world = make_world(trial.level, trial.seed)
    flight = CONTENDERS[trial.planner].fly(world)
    known: Row = {"planner": trial.planner, "level": trial.level, "seed": trial.seed}
    judged = _NOT_FLOWN if flight.plan is None else judge_flight(world, Flown.of(flight.plan))
    times = {name: quantile_ms(flight.replan_ms, share) for name, share in _REPLANS.items()}
    return known | judged | {"first_plan_ms": flight.first_ms} | times


_REPLANS = {"replan_p50_ms": 0.5, "replan_p95_ms": 0.95}
_NOT_FLOWN: Row = {"success": False, "arrived": False, "touched_boxes": False, "touched_cubes": False} | dict.fromkeys(
    ("time_s", "path_m", "jerk_mps2", "least_distance_m", "largest_y_m", "violations_percent")
)


def quantile_ms(times: Sequence[float], share: float) -> float | None:
    """Quantile of times [ms]; None of none."""
    return float(np.quantile(times, share)) if len(times) else None


def summarize(rows: Sequence[Row], missing: Row) -> Row:
    """Successes and numbers of each planner in each level."""
    methods: Row = {}
    for name, entry in CONTENDERS.items():
        mine = [row for row in rows if row["planner"] == name]
        levels = {level: _numbers([row for row in mine if row["level"] == level]) for level in LEVELS}
        methods[name] = {"skipped": missing[name]} if name in missing else {"knows": entry.knows} | levels
    return {"methods": methods}


def _numbers(rows: Sequence[Row]) -> Row:
    """Counts over all flights, and medians over those that succeeded."""
    good = [row for row in rows if row["success"]]

    def median(name: str, some: Sequence[Row]) -> float | None:
        values = _all(some, name)
        return float(np.median(values)) if values else None

    return {
        "worlds": len(rows),
        "successes": len(good),
        "time_median_s": median("time_s", good),
        "path_median_m": median("path_m", good),
        "jerk_median_mps2": median("jerk_mps2", good),
        "least_distance_m": min(_all(good, "least_distance_m"), default=None),
        "largest_y_m": max(_all(good, "largest_y_m"), default=None),
        "violations_percent": float(np.mean(_all(rows, "violations_percent") or [0.0])),
        "first_plan_median_ms": median("first_plan_ms", rows),
        "replan_p50_ms": median("replan_p50_ms", rows),
        "replan_p95_ms": max(_all(rows, "replan_p95_ms"), default=None),
    }


def _all(rows: Sequence[Row], key: str) -> list[Any]:
    """Values of a column, without those that do not exist."""
    return [row[key] for row in rows if row[key] is not None]


def draw_figure(rows: Sequence[Row]) -> Figure:
    """Successes by level, travel times, and times of replans."""
    figure, (success, travel, replan) = panels(("Successful flights", "Travel time", "Time of a replan, median"))
    names = list(dict.fromkeys(row["planner"] for row in rows))
    shares: dict[str, float] = {}
    for name in names:
        for level in LEVELS:
            flown = [row["success"] for row in rows if (row["planner"], row["level"]) == (name, level)]
            shares[f"{name}\n{level}"] = 100 * float(np.mean(flown or [False]))
    bars(success, shares, "% of worlds")
    success.tick_params(axis="x", labelsize=5, rotation=60)
    for index, name in enumerate(names):
        mine, color = [row for row in rows if row["planner"] == name], COLORS[index % len(COLORS)]
        draw_distribution(travel, _all([row for row in mine if row["success"]], "time_s"), color, name)
        draw_distribution(replan, _all(mine, "replan_p50_ms"), color, name)
    travel.set(xlabel="time at most [s]", ylabel="share of successes", ylim=(0, 1))
    replan.set(xscale="log", xlabel="time at most [ms]", ylabel="share of flights", ylim=(0, 1))
    for axes in (travel, replan):
        if axes.lines:
            axes.legend(frameon=False, fontsize=7)
    return figure
