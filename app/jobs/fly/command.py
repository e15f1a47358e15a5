"""Command that flies a flight again: `nerfnav fly ...`, from its request.

It holds what differs from the defaults alone, and every number with all its digits: the same command gives the same
flight, step for step. Where a duration was found by search, the command has the steps that were found.
"""

import math
import shlex
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from nerfnav.navigation import NavigateConfig
from nerfnav.planner import planners
from nerfnav.planner.solvers.duration import is_hurried
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.place import Place
from nerfnav_app.storage.kept_obstacles import KEPT

_ROBOT = "quadrotor"
"""Robot of a place that is opened without a task and without `--robot`."""


def command_of(request: FlyRequest, place: Place, steps: int | None, dt: float) -> str:
    """Write the command line of a flight, quoted for a shell.

    `steps` and `dt` [s] are those of its first plan; `steps` is None where there is no plan and its duration is to be
    found. The operator's requests on the way are not in it.
    """
    route, default = request.route, FlyRequest(request.route)
    task = _number_of_task(request, place)
    words = ["nerfnav", "fly", request.source or place.name]
    words += _words_of_ends(route.ends, task)
    robot = place.robot.source
    words += _option("--robot", robot, _ROBOT if task is None else place.tasks[task].robot)
    words += _option("--planner", route.planner, PlanRequest.planner)
    words += _words_of_duration(route.ends, place, task is not None, steps, dt)
    words += _option("--unknown", route.unknown.value, PlanRequest.unknown.value)
    words += _option("--max-collision", route.max_collision, None)
    words += _option("--max-blind", route.max_blind, None)
    words += _option("--estimator", request.estimator, default.estimator)
    if request.camera is not None:
        words += ["--camera", str(request.camera)]
    if (obstacles := _obstacles_of(request, place)) is not None:
        words += ["--obstacles", str(obstacles)]
    words += ["--open-loop"] if request.open_loop or route.flight.open_loop else []
    words += _option("--world", route.world, PlanRequest.world)
    words += ["--realtime"] if request.realtime else []
    words += ["--watch"] if route.watch else []
    words += _option("--seed", request.seed, default.seed)
    return shlex.join([*words, *_words_of_settings(route)])


def _obstacles_of(request: FlyRequest, place: Place) -> Path | None:
    """The file of obstacles that was given, else the one that the flight keeps."""
    if request.obstacles is None and request.out is not None and place.obstacles is not None:
        return request.out / KEPT
    return request.obstacles


def _number_of_task(request: FlyRequest, place: Place) -> int | None:
    """Number of the task that is flown, in its place; None where start and goal were chosen freely."""
    for number, task in enumerate(place.tasks):
        if task.name == request.task and Ends.of_task(task) == request.route.ends:
            return number
    return None


def _words_of_ends(ends: Ends, task: int | None) -> list[str]:
    if task is None:
        return ["--start", *_words_of_end(ends.start), "--goal", *_words_of_end(ends.goal)]
    return _option("--task", task, 0)


def _words_of_end(end: End) -> list[str]:
    return [_word(number) for number in (*end.position, *([end.yaw] if end.yaw else []))]


def _words_of_duration(ends: Ends, place: Place, has_task: bool, steps: int | None, dt: float) -> list[str]:
    """Words for the duration of the first plan, the shortest that give it exactly."""
    if steps is None:
        return ["--duration", "auto"]
    distance = math.dist(ends.start.position, ends.goal.position)
    found = not has_task or is_hurried(place.robot, distance, PlanRequest.steps * PlanRequest.dt)
    if dt == PlanRequest.dt:
        return ["--steps", str(steps)] if found or steps != PlanRequest.steps else []
    seconds = round(steps * dt, 9)
    same = PlanRequest(ends).lasting(seconds)
    if (same.steps, same.dt) == (steps, dt):
        return ["--duration", _word(seconds)]
    return ["--steps", str(steps), "--dt", _word(dt)]


def _words_of_settings(route: PlanRequest) -> list[str]:
    """Words for the settings of planner and flight that differ from the defaults."""
    entry, settings, again, flight = planners.load(route.planner), route.settings, route.again, route.flight
    words = ["--paper-cost"] if route.paper_cost else []
    if again is not None and again != entry.again(settings):
        if again == entry.in_flight(settings, again.weights.risk):
            words += ["--risk-weight", _word(again.weights.risk)]
        else:
            words += _differences(again, entry.again(entry.config()), "replan.")
    words += _differences(settings, entry.config(), "plan.")
    flight = replace(flight, open_loop=NavigateConfig.open_loop)
    return [*words, *_differences(flight, NavigateConfig(), "")]


def _differences(given: Any, default: Any, prefix: str) -> Iterator[str]:
    """Options for the fields of a record that differ from another one of its type, nested records too."""
    for part in fields(given):
        value, usual = getattr(given, part.name), getattr(default, part.name)
        name = part.name.replace("_", "-")
        if value == usual:
            continue
        if is_dataclass(value) and type(value) is type(usual):
            yield from _differences(value, usual, f"{prefix}{name}.")
        elif isinstance(value, bool):
            yield f"--{prefix}{'' if value else 'no-'}{name}"
        else:
            yield from (f"--{prefix}{name}", *map(_word, value if isinstance(value, tuple) else (value,)))


def _option(name: str, value: Any, default: Any) -> list[str]:
    return [] if value == default else [name, _word(value)]


def _word(value: Any) -> str:
    """Value as a word: floats with all their digits, and without an exponent, which a sign would make an option."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, float) and "e" in repr(value):
        return np.format_float_positional(value, trim="0")
    return str(value)
