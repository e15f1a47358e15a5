"""Vehicles that fly exports: RotorPy's multirotor under RotorPy's SE(3) controller, or under Mellinger's controller as
the Crazyflie's firmware has it (drone-controllers).

    quick        a multirotor of the mass, inertia and thrust that were planned for, with the rotors of RotorPy's
                 Hummingbird and a quick attitude loop, on setpoints as PX4 gets them: each is held until the next comes
    crazyflie    RotorPy's Crazyflie under Mellinger's controller, on polynomials, evaluated as the firmware does

Lee, Leok and McClamroch 2010 (SE(3)); Mellinger and Kumar 2011; Folk, Paulos and Kumar, "RotorPy", 2023.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from nerfnav.extras import from_extra
from nerfnav.robots import Quadrotor, QuadrotorConfig

_USER = "the experiment reflight"


@dataclass(frozen=True)
class Wish:
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
    """What a vehicle is told, and for how long."""

    wish: Callable[[float], Wish]
    """Setpoint at a time [s]; at rest at the last position after the end."""
    duration: float
    """[s]"""


@dataclass(frozen=True)
class FlownConfig:
    """How flights are simulated."""

    rate_hz: int = 500
    """Of controllers and of the integration."""
    settling_s: float = 0.5
    """How long the end is held."""
    kp_att: float = 2000.0
    """Attitude gain of the quick loop [1/s^2]."""
    kd_att: float = 90.0
    """Rate gain of the quick loop [1/s]."""


@dataclass(frozen=True)
class Flown:
    """Where a vehicle was, and should have been."""

    times: np.ndarray
    """(n,) [s]."""
    position: np.ndarray
    """(n, 3) [m]."""
    velocity: np.ndarray
    """(n, 3) [m/s]."""
    quaternion: np.ndarray
    """(n, 4), (x, y, z, w) of R_world_body."""
    error_m: np.ndarray
    """(n,): distance from what was wished."""


Control = Callable[[float, dict[str, Any], Wish], dict[str, Any]]


def fly_quick(track: Track, robot: Quadrotor, config: FlownConfig) -> Flown:
    """The robot with the rotors of a Hummingbird, which answer within 5 ms, under the SE(3) controller."""
    params = _scaled(_params("hummingbird"), robot.config) | {"kp_att": config.kp_att, "kd_att": config.kd_att}
    controller = from_extra("rotorpy.controllers.quadrotor_control", "reflight", _USER).SE3Control(params)

    def control(time: float, state: dict[str, Any], wish: Wish) -> dict[str, Any]:
        return controller.update(time, state, _flat_output(wish))

    return _fly(params, "cmd_motor_speeds", control, track, config)


def _scaled(params: dict[str, Any], robot: QuadrotorConfig) -> dict[str, Any]:
    """A vehicle of a robot's mass, inertia, size and thrust: forces of rotors and air in proportion to the thrust."""
    arm = np.linalg.norm(next(iter(params["rotor_pos"].values())))
    size = np.hypot(*robot.extents[:2]) / 2 / arm
    strength = robot.max_thrust / (params["num_rotors"] * params["k_eta"] * params["rotor_speed_max"] ** 2)
    forces = {name: strength * params[name] for name in ("k_eta", "k_m", "k_d", "k_z", "k_h", "c_Dx", "c_Dy", "c_Dz")}
    inertia = dict(zip(("Ixx", "Iyy", "Izz"), robot.inertia, strict=True))
    places = {name: size * place for name, place in params["rotor_pos"].items()}
    return params | forces | inertia | {"mass": robot.mass, "rotor_pos": places}


def fly_crazyflie(track: Track, robot: Quadrotor, config: FlownConfig) -> Flown:
    """RotorPy's Crazyflie, whatever was planned for, under Mellinger's controller with the gains of the firmware."""
    os.environ.setdefault("SCIPY_ARRAY_API", "1")  # drone-controllers asks for it where scipy is imported already
    library = from_extra("drone_controllers", "reflight", _USER)
    mellinger = from_extra("drone_controllers.mellinger", "reflight", _USER)
    position = library.parametrize(mellinger.state2attitude, "cf2x_L250")
    attitude = library.parametrize(mellinger.attitude2force_torque, "cf2x_L250")
    errors: dict[str, Any] = {"position": None, "attitude": None, "rate": None}

    def control(time: float, state: dict[str, Any], wish: Wish) -> dict[str, Any]:
        seen = {"pos": state["x"], "quat": state["q"], "vel": state["v"], "ang_vel": state["w"]}
        asked = np.concatenate([wish.position, wish.velocity, wish.acceleration, [wish.yaw, 0.0, 0.0, wish.yaw_rate]])
        attitude_wish, errors["position"] = position(
            **seen, cmd=asked, ctrl_errors=_kept(errors["position"]), ctrl_freq=config.rate_hz
        )
        force, torque, errors["attitude"] = attitude(
            **seen, cmd=attitude_wish, prev_ang_vel=errors["rate"], ctrl_errors=_kept(errors["attitude"]),
            ctrl_freq=config.rate_hz,
        )  # fmt: skip
        errors["rate"] = state["w"]
        return {"cmd_thrust": float(force[0]), "cmd_moment": torque}

    return _fly(_params("crazyflie"), "cmd_ctbm", control, track, config)


def _kept(error: Any) -> tuple[Any] | None:
    return None if error is None else (error,)


def _params(vehicle: str) -> dict[str, Any]:
    return dict(from_extra(f"rotorpy.vehicles.{vehicle}_params", "reflight", _USER).quad_params)


def _flat_output(wish: Wish) -> dict[str, Any]:
    still = np.zeros(3)
    return {
        "x": wish.position, "x_dot": wish.velocity, "x_ddot": wish.acceleration, "x_dddot": still, "x_ddddot": still,
        "yaw": wish.yaw, "yaw_dot": wish.yaw_rate,
    }  # fmt: skip


def _fly(params: dict[str, Any], abstraction: str, control: Control, track: Track, config: FlownConfig) -> Flown:
    """From rest at the first setpoint along the track, and for a while at its end."""
    first, dt = track.wish(0.0), 1 / config.rate_hz
    hover = np.sqrt(params["mass"] * 9.81 / (params["num_rotors"] * params["k_eta"]))
    state = {
        "x": first.position.copy(), "v": np.zeros(3),
        "q": np.array([0, 0, np.sin(first.yaw / 2), np.cos(first.yaw / 2)]),
        "w": np.zeros(3), "wind": np.zeros(3), "rotor_speeds": np.full(params["num_rotors"], hover),
    }  # fmt: skip
    multirotor = from_extra("rotorpy.vehicles.multirotor", "reflight", _USER).Multirotor
    vehicle = multirotor(params, state, abstraction, integrator_kwargs={"method": "RK23", "max_step": dt})
    rows = []
    for index in range(round((track.duration + config.settling_s) * config.rate_hz) + 1):
        wish = track.wish(index * dt)
        rows.append((index * dt, state["x"], state["v"], state["q"], np.linalg.norm(state["x"] - wish.position)))
        state = vehicle.step(state, control(index * dt, state, wish), dt)
    return Flown(*(np.array(column) for column in zip(*rows, strict=True)))
