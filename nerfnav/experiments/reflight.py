"""Exports flown again: plans leave as files, and vehicles of other people's simulators fly what the files say.

Each task of a quadrotor is planned on the field and exported twice: as setpoints for PX4, which RotorPy's SE(3)
controller follows with a quick attitude loop; and as polynomials for a Crazyflie, with a duration that its thrust
allows, which Mellinger's controller follows (nerfnav.experiments.reflight_vehicles). What was flown is judged on the
true mesh with the body that was planned for, and compared with what was wished for.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.contenders import ROBOT, contender_for
from nerfnav.experiments.reflight_results import picture, summary_of
from nerfnav.experiments.reflight_tracks import track_of_crazyflie, track_of_px4
from nerfnav.experiments.reflight_vehicles import Flown, FlownConfig, Track, fly_crazyflie, fly_quick
from nerfnav.experiments.study import ExperimentStep, Results, Row, Study, run_trials
from nerfnav.export import Exported, Recording
from nerfnav.export.crazyflie import FitConfig, crazyflie
from nerfnav.export.px4 import px4
from nerfnav.geometry import so3
from nerfnav.planner import PlanStep, Route
from nerfnav.robots import Quadrotor, RigidState
from nerfnav.world import Task, judge

_STEPS, _DT = 20, 0.1
"""Length of a flight: 2 s, as in the paper."""
_JUDGED_HZ = 50
_MEASURED = ("clean", "max_overlap_m3", "rms_mm", "max_mm", "duration_s")
_CRAZYFLIE_THRUST = 1.1
"""Most thrust that a Crazyflie's file asks for, as a share of the weight: it has 1.6, and its controller, whose motors
answer within 70 ms, needs the rest."""


@dataclass(frozen=True)
class Vehicle:
    """Who flies which file."""

    name: str
    """What the table calls it."""
    export: Callable[[Recording], Exported]
    """Makes the file."""
    track: Callable[[bytes], Track]
    """Reads it."""
    fly: Callable[[Track, Quadrotor, FlownConfig], Flown]
    """Flies it."""


VEHICLES = (
    Vehicle("rotorpy-se3", px4, track_of_px4, fly_quick),
    Vehicle(
        "crazyflie-mellinger",
        partial(crazyflie, config=FitConfig(thrust_per_weight=_CRAZYFLIE_THRUST)),
        track_of_crazyflie,
        fly_crazyflie,
    ),
)


def run(study: Study) -> Iterator[ExperimentStep]:
    """Fly the exports of all tasks of quadrotors, here and in the places beside."""
    rows: list[Row] = []
    for where in (study, *study.beside):
        tasks = [task for task in where.tasks if task.robot == ROBOT.name]
        answers = yield from run_trials(where, "flying again", reflown, where.first(tasks, "tasks of a quadrotor"))
        rows += [row for answer in answers for row in answer]
    yield Results(summary_of(rows), tuple(rows), {"reflight": partial(picture, rows)})


def reflown(arena: Arena, task: Task) -> list[Row]:
    """Plan a task, and fly its exports."""
    *_, plan = contender_for(arena, "nerfnav", 1).plan(Route(task.start_state, task.goal_state, _STEPS, _DT))
    return [_row(arena, task, plan, vehicle) for vehicle in VEHICLES]


def _row(arena: Arena, task: Task, plan: PlanStep, vehicle: Vehicle) -> Row:
    told: Row = {
        "task": task.name,
        "vehicle": vehicle.name,
        "plan": plan.outcome.name.lower() if plan.outcome else "",
        "plan_touched": bool(judge(arena.scene, ROBOT.body, plan.motion.states).touched_poses.any()),
    }
    try:
        exported = vehicle.export(Recording.of_plan(plan.motion, ROBOT, task.name, plan.outcome))
    except InvalidInputError as error:
        return told | {"exported": str(error)} | dict.fromkeys(_MEASURED)
    track = vehicle.track(exported.content)
    flown = vehicle.fly(track, ROBOT, FlownConfig())
    report = judge(arena.scene, ROBOT.body, poses_of(flown))
    rms, most = float(np.sqrt(np.mean(flown.error_m**2))), float(flown.error_m.max())
    clean = not bool(report.touched_poses.any())
    measured = (clean, report.max_overlap_m3, 1e3 * rms, 1e3 * most, track.duration)
    return told | {"exported": "", **dict(zip(_MEASURED, measured, strict=True))}


def poses_of(flown: Flown) -> RigidState:
    """What was flown, some 50 times a second."""
    every = max(1, round(1 / (_JUDGED_HZ * float(flown.times[1]))))
    x, y, z, w = torch.from_numpy(flown.quaternion[::every]).float().unbind(-1)
    position, velocity = (torch.from_numpy(part[::every]).float() for part in (flown.position, flown.velocity))
    rotation = so3.matrix_from_quaternion(torch.stack([w, x, y, z], -1))
    return RigidState(position, velocity, rotation, torch.zeros_like(position))
