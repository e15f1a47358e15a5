"""Reflight of exports: fly exported plans with the vehicles of other simulators.

Each task of a quadrotor is planned on the field and exported twice: as setpoints for PX4, which RotorPy's SE(3)
controller follows with a quick attitude loop; and as polynomials for a Crazyflie, with a duration that its thrust
allows, which Mellinger's controller follows, as the Crazyflie's firmware has it (drone-controllers). The files are
read without nerfnav, by NumPy. The flights are judged on the true mesh with the
body that was planned for, and compared with the setpoints.

    quick        a multirotor of the mass, inertia and thrust that were planned for, with the rotors of RotorPy's
                 Hummingbird and a quick attitude loop, on setpoints as PX4 gets them, each held until the next comes
    crazyflie    RotorPy's Crazyflie under Mellinger's controller, on polynomials, evaluated as the firmware does

Lee, Leok and McClamroch 2010 (SE(3)); Mellinger and Kumar 2011; Folk, Paulos and Kumar, "RotorPy", 2023.
"""

import io
import math
import os
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.extras import import_extra
from nerfnav.core.steps import run_steps
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.figures import Figure, bars, panels
from nerfnav.experiments.planners import ROBOT, make_contender
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study, run_trials
from nerfnav.export import Exported, Recording
from nerfnav.export.autopilots import px4
from nerfnav.export.crazyflie import crazyflie
from nerfnav.geometry import so3
from nerfnav.planner import PlanResult, Route
from nerfnav.robots import Quadrotor, QuadrotorConfig, RigidState
from nerfnav.world import Task, judge

_USER = "the experiment reflight"


@dataclass(frozen=True)
class Setpoint:
    """Setpoint of an instant: what is to be flown, ENU."""

    position: np.ndarray
    """[m]"""
    velocity: np.ndarray
    """[m/s]"""
    acceleration: np.ndarray
    """[m/s^2]"""
    yaw: float
    """[rad]"""
    yaw_rate: float
    """[rad/s]"""


@dataclass(frozen=True)
class Track:
    """Reference of a vehicle, and its duration."""

    setpoint: Callable[[float], Setpoint]
    """Setpoint at a time [s]; at rest at the last position after the end."""
    duration: float
    """[s]"""


_RATE_HZ, _SETTLING_S = 500, 0.5
"""Rate of controllers and of the integration, and time for which the end is held [s]."""
_QUICK = {"kp_att": 2000.0, "kd_att": 90.0}
"""Gains of the quick loop: attitude [1/s^2] and rate [1/s]."""


@dataclass(frozen=True)
class Flown:
    """Simulated flight with its tracking error."""

    times: np.ndarray
    """(n,) [s]."""
    position: np.ndarray
    """(n, 3) [m]."""
    velocity: np.ndarray
    """(n, 3) [m/s]."""
    quaternion: np.ndarray
    """(n, 4), (x, y, z, w) of R_world_body."""
    error_m: np.ndarray
    """(n,): distance from the setpoint."""


Control = Callable[[float, dict[str, Any], Setpoint], dict[str, Any]]


def fly_quick(track: Track, robot: Quadrotor) -> Flown:
    """The robot with the rotors of a Hummingbird, which answer within 5 ms, under the SE(3) controller."""
    params = _scaled(_params("hummingbird"), robot.config) | _QUICK
    controller = import_extra("rotorpy.controllers.quadrotor_control", "reflight", _USER).SE3Control(params)

    def control(time: float, state: dict[str, Any], setpoint: Setpoint) -> dict[str, Any]:
        flat_output = {
            "x": setpoint.position, "x_dot": setpoint.velocity, "x_ddot": setpoint.acceleration,
            "x_dddot": np.zeros(3), "x_ddddot": np.zeros(3),
            "yaw": setpoint.yaw, "yaw_dot": setpoint.yaw_rate,
        }  # fmt: skip
        return controller.update(time, state, flat_output)

    return _fly(params, "cmd_motor_speeds", control, track)


def _scaled(params: dict[str, Any], robot: QuadrotorConfig) -> dict[str, Any]:
    """A vehicle of a robot's mass, inertia, size and thrust: forces of rotors and air in proportion to the thrust."""
    arm = np.linalg.norm(next(iter(params["rotor_pos"].values())))
    size = np.hypot(*robot.extents[:2]) / 2 / arm
    strength = robot.max_thrust / (params["num_rotors"] * params["k_eta"] * params["rotor_speed_max"] ** 2)
    forces = {name: strength * params[name] for name in ("k_eta", "k_m", "k_d", "k_z", "k_h", "c_Dx", "c_Dy", "c_Dz")}
    inertia = dict(zip(("Ixx", "Iyy", "Izz"), robot.inertia, strict=True))
    places = {name: size * place for name, place in params["rotor_pos"].items()}
    return params | forces | inertia | {"mass": robot.mass, "rotor_pos": places}


def fly_crazyflie(track: Track, robot: Quadrotor) -> Flown:
    """RotorPy's Crazyflie, whatever was planned for, under Mellinger's controller with the gains of the firmware."""
    os.environ.setdefault("SCIPY_ARRAY_API", "1")  # drone-controllers asks for it where scipy is imported already
    library = import_extra("drone_controllers", "reflight", _USER)
    mellinger = import_extra("drone_controllers.mellinger", "reflight", _USER)
    position = library.parametrize(mellinger.state2attitude, "cf2x_L250")
    attitude = library.parametrize(mellinger.attitude2force_torque, "cf2x_L250")
    errors: dict[str, Any] = {"position": None, "attitude": None, "rate": None}

    def control(time: float, state: dict[str, Any], setpoint: Setpoint) -> dict[str, Any]:
        seen = {"pos": state["x"], "quat": state["q"], "vel": state["v"], "ang_vel": state["w"]}
        heading = [setpoint.yaw, 0.0, 0.0, setpoint.yaw_rate]
        command = np.concatenate([setpoint.position, setpoint.velocity, setpoint.acceleration, heading])
        attitude_setpoint, errors["position"] = position(
            **seen, cmd=command, ctrl_errors=_previous(errors["position"]), ctrl_freq=_RATE_HZ
        )
        force, torque, errors["attitude"] = attitude(
            **seen, cmd=attitude_setpoint, prev_ang_vel=errors["rate"], ctrl_errors=_previous(errors["attitude"]),
            ctrl_freq=_RATE_HZ,
        )  # fmt: skip
        errors["rate"] = state["w"]
        return {"cmd_thrust": float(force[0]), "cmd_moment": torque}

    return _fly(_params("crazyflie"), "cmd_ctbm", control, track)


def _previous(error: Any) -> tuple[Any] | None:
    return None if error is None else (error,)


def _params(vehicle: str) -> dict[str, Any]:
    return dict(import_extra(f"rotorpy.vehicles.{vehicle}_params", "reflight", _USER).quad_params)


def _fly(params: dict[str, Any], abstraction: str, control: Control, track: Track) -> Flown:
    """From rest at the first setpoint along the track, and for a while at its end."""
    first, dt = track.setpoint(0.0), 1 / _RATE_HZ
    hover = np.sqrt(params["mass"] * 9.81 / (params["num_rotors"] * params["k_eta"]))
    state = {
        "x": first.position.copy(), "v": np.zeros(3),
        "q": np.array([0, 0, np.sin(first.yaw / 2), np.cos(first.yaw / 2)]),
        "w": np.zeros(3), "wind": np.zeros(3), "rotor_speeds": np.full(params["num_rotors"], hover),
    }  # fmt: skip
    multirotor = import_extra("rotorpy.vehicles.multirotor", "reflight", _USER).Multirotor
    vehicle = multirotor(params, state, abstraction, integrator_kwargs={"method": "RK23", "max_step": dt})
    rows = []
    for index in range(round((track.duration + _SETTLING_S) * _RATE_HZ) + 1):
        setpoint = track.setpoint(index * dt)
        rows.append((index * dt, state["x"], state["v"], state["q"], np.linalg.norm(state["x"] - setpoint.position)))
        state = vehicle.step(state, control(index * dt, state, setpoint), dt)
    return Flown(*(np.array(column) for column in zip(*rows, strict=True)))


def track_of_px4(content: bytes) -> Track:
    """Setpoints of a file of the format px4; each row is held until the next comes."""
    rows = np.genfromtxt(io.BytesIO(content), delimiter=",", skip_header=2)
    seconds = 1e-6 * rows[:, 0]
    # north, east, down to east, north, up
    position, velocity, acceleration = (rows[:, [east, east - 1, east + 1]] * [1, 1, -1] for east in (2, 5, 8))
    yaw, yaw_rate = np.pi / 2 - rows[:, 13], -rows[:, 14]

    def setpoint(time: float) -> Setpoint:
        row = max(0, int(np.searchsorted(seconds, time + 1e-9, side="right")) - 1)
        return Setpoint(position[row], velocity[row], acceleration[row], float(yaw[row]), float(yaw_rate[row]))

    return Track(setpoint, float(seconds[-1]))


def track_of_crazyflie(content: bytes) -> Track:
    """Polynomials of a file of the format crazyflie, evaluated piece by piece."""
    rows = np.loadtxt(io.BytesIO(content), delimiter=",", skiprows=1, usecols=range(33))
    ends = rows[:, 0].cumsum()
    derivatives = [[np.polynomial.Polynomial(row[1:].reshape(4, 8)[axis]) for axis in range(4)] for row in rows]
    orders = [[[one.deriv(order) for one in piece] for piece in derivatives] for order in (1, 2)]

    def setpoint(time: float) -> Setpoint:
        held = min(time, ends[-1])
        piece = min(int(np.searchsorted(ends, held)), len(rows) - 1)
        local = held - ends[piece] + rows[piece, 0]
        value, first, second = (np.array([one(local) for one in part[piece]]) for part in (derivatives, *orders))
        moving = float(time <= ends[-1])
        return Setpoint(value[:3], moving * first[:3], moving * second[:3], float(value[3]), moving * float(first[3]))

    return Track(setpoint, float(ends[-1]))


_STEPS, _DT = 20, 0.1
"""Length of a flight: 2 s, as in the paper."""
_JUDGED_HZ = 50
_MEASURED = ("clean", "max_overlap_m3", "rms_mm", "max_mm", "duration_s")
_CRAZYFLIE_THRUST = 1.1
"""Most thrust that a Crazyflie's file asks for, as a share of the weight: it has 1.6, and its controller, whose motors
answer within 70 ms, needs the rest."""


@dataclass(frozen=True)
class Vehicle:
    """Vehicle: its export format and simulator."""

    name: str
    """Name in the table."""
    export: Callable[[Recording], Exported]
    """Makes the file."""
    track: Callable[[bytes], Track]
    """Reads it."""
    fly: Callable[[Track, Quadrotor], Flown]
    """Flies it."""


VEHICLES = (
    Vehicle("rotorpy-se3", px4, track_of_px4, fly_quick),
    Vehicle(
        "crazyflie-mellinger",
        partial(crazyflie, thrust_per_weight=_CRAZYFLIE_THRUST),
        track_of_crazyflie,
        fly_crazyflie,
    ),
)


def run(study: Study) -> ExperimentSteps:
    """Fly the exports of all tasks of quadrotors, here and in the places beside."""
    rows: list[Row] = []
    for where in (study, *study.beside):
        tasks = [task for task in where.tasks if task.robot == ROBOT.name]
        answers = yield from run_trials(where, "flying again", fly_exports, where.first(tasks, "tasks of a quadrotor"))
        rows += [row for answer in answers for row in answer]
    return Results(summarize(rows), tuple(rows), {"reflight": partial(draw_figure, rows)}, ("vehicle",))


def fly_exports(arena: Arena, task: Task) -> list[Row]:
    """Plan a task, and fly its exports."""
    route = Route(task.start_state, task.goal_state, _STEPS, _DT)
    plan = run_steps(make_contender(arena, "nerfnav", 1).plan(route))
    return [_row(arena, task, plan, vehicle) for vehicle in VEHICLES]


def _row(arena: Arena, task: Task, plan: PlanResult, vehicle: Vehicle) -> Row:
    known: Row = {
        "task": task.name,
        "vehicle": vehicle.name,
        "plan": plan.outcome.name.lower(),
        "plan_touched": bool(judge(arena.scene, ROBOT.body, plan.motion.states).touched_poses.any()),
    }
    try:
        exported = vehicle.export(Recording.of_plan(plan.motion, ROBOT, task.name, plan.outcome))
    except InvalidInputError as error:
        return known | {"exported": str(error)} | dict.fromkeys(_MEASURED)
    track = vehicle.track(exported.content)
    flown = vehicle.fly(track, ROBOT)
    report = judge(arena.scene, ROBOT.body, poses_of(flown))
    rms, most = float(np.sqrt(np.mean(flown.error_m**2))), float(flown.error_m.max())
    measured = (not bool(report.touched_poses.any()), report.max_overlap_m3, 1e3 * rms, 1e3 * most, track.duration)
    return known | {"exported": "", **dict(zip(_MEASURED, measured, strict=True))}


def poses_of(flown: Flown) -> RigidState:
    """States of the simulated flight, about 50 times a second."""
    every = max(1, round(1 / (_JUDGED_HZ * float(flown.times[1]))))
    x, y, z, w = torch.from_numpy(flown.quaternion[::every]).float().unbind(-1)
    position, velocity = (torch.from_numpy(part[::every]).float() for part in (flown.position, flown.velocity))
    rotation = so3.matrix_from_quaternion(torch.stack([w, x, y, z], -1))
    return RigidState(position, velocity, rotation, torch.zeros_like(position))


def summarize(rows: Sequence[Row]) -> dict[str, Row]:
    """For each vehicle: how many flights were clean, and how far off they were (rms over all instants and flights)."""
    summary = {}
    for name in _vehicles(rows):
        mine = [row for row in rows if row["vehicle"] == name]
        flown = [row for row in mine if row["rms_mm"] is not None]
        summary[name] = {
            "exports": len(mine),
            "refused": len(mine) - len(flown),
            "clean": sum(bool(row["clean"]) for row in mine),
            "clean_plans": sum(not row["plan_touched"] for row in mine),
        }
        if flown:
            summary[name] |= {
                "rms_mm": math.sqrt(statistics.fmean(row["rms_mm"] ** 2 for row in flown)),
                "rms_mm_max": max(row["rms_mm"] for row in flown),
                "max_mm": max(row["max_mm"] for row in flown),
                "duration_s_mean": statistics.fmean(row["duration_s"] for row in flown),
            }
    return summary


def draw_figure(rows: Sequence[Row]) -> Figure:
    """Errors of every flight as dots, and the largest of them as bars."""
    figure, (rms, most) = panels(("Tracking error, rms", "Tracking error, largest"))
    for axes, key in ((rms, "rms_mm"), (most, "max_mm")):
        samples = {name: [row[key] for row in rows if row["vehicle"] == name and row[key]] for name in _vehicles(rows)}
        bars(axes, {name: statistics.fmean(values) for name, values in samples.items() if values}, "mm, mean", samples)
    return figure


def _vehicles(rows: Sequence[Row]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(row["vehicle"] for row in rows))
