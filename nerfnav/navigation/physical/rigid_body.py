"""Multirotor: Newton-Euler equations, integrated by Runge-Kutta of the fourth order, and the lag of motors and rotors.

    p' = v     m v' = R e3 sum(k s^2) + m g + F     R' = R hat(w)     J w' = tau(s) - w x J w

with rotor speeds s, the force F of the air [N], thrusts k s^2 along the body's z axis, and torques of their levers and
of the rotors' own drag. This is one robot, in double precision: vectors are (3,), rotations (3, 3), rotor speeds (r,),
a wrench of thrust and torque (4,). Shapes stand in comments alone, for these are called thousands of times a second.
"""

from dataclasses import dataclass, field

import numpy as np

from nerfnav.navigation.physical.config import PhysicalConfig


@dataclass(frozen=True)
class Airframe:
    """Mass, inertia and rotors of a multirotor."""

    mass: float
    """m [kg]."""
    inertia: np.ndarray
    """Diagonal of J [kg m^2]."""
    rotors: np.ndarray
    """Positions of the rotors in the body, (r, 3) [m]."""
    spins: np.ndarray
    """1 or -1: the sign of the torque about z with which a rotor's drag turns the body."""
    thrust_coefficient: float
    """k [N s^2]."""
    torque_coefficient: float
    """[N m s^2]."""
    gravity: float = 9.81
    """[m/s^2]"""

    @property
    def allocation(self) -> np.ndarray:
        """Allocation matrix from the rotors' thrusts [N] to thrust [N] and torque [N m], (4, r)."""
        yaw = self.spins * self.torque_coefficient / self.thrust_coefficient
        return np.stack([np.ones(len(self.rotors)), self.rotors[:, 1], -self.rotors[:, 0], yaw])


@dataclass(frozen=True)
class BodyState:
    """State of a rigid body, in double precision."""

    position: np.ndarray
    """p, in the world [m]."""
    velocity: np.ndarray
    """v, in the world [m/s]."""
    rotation: np.ndarray
    """R_world_body."""
    body_rate: np.ndarray
    """w, in the body's axes [rad/s]."""


@dataclass
class Powertrain:
    """Motors and rotors: speeds follow their commands with a lag, within limits; at first those of hover."""

    frame: Airframe
    """Nominal airframe, which the commands are made for."""
    world: PhysicalConfig
    """Limits and lag."""
    lead: float
    """Lead compensation of the lag: factor on the difference of a rotor's speed from its target."""
    speeds: np.ndarray = field(init=False)
    """Of the rotors [rad/s]."""

    def __post_init__(self) -> None:
        """Start with the speeds of hover."""
        count = len(self.frame.rotors)
        each = self.frame.mass * self.frame.gravity / count / self.frame.thrust_coefficient
        self.speeds = np.full(count, np.sqrt(each))
        self._inverse = np.linalg.pinv(self.frame.allocation)

    def spin(self, target: np.ndarray, dt: float) -> np.ndarray:
        """Return the thrust [N] and torque [N m] after `dt` [s] of a target: thrust for each kg, and torque.

        Where rotors reach their limits, roll and pitch come first, then thrust, and yaw last.
        """
        world, coefficient = self.world, self.frame.thrust_coefficient
        least, most = world.slowest_radps**2, world.fastest_radps**2
        squares = self._inverse @ np.array([self.frame.mass * target[0], target[1], target[2], 0.0]) / coefficient
        squares = squares + max(0.0, least - squares.min())
        squares = (squares - max(0.0, squares.max() - most)).clip(least, most)
        yawing = self._inverse[:, 3] * target[3] / coefficient
        room = np.where(yawing > 0, most - squares, squares - least)
        share = min(1.0, float((room / np.maximum(np.abs(yawing), 1e-9)).min()))
        aim = np.sqrt((squares + share * yawing).clip(least, most))
        command = np.clip(self.speeds + self.lead * (aim - self.speeds), world.slowest_radps, world.fastest_radps)
        self.speeds = command + (self.speeds - command) * np.exp(-dt / world.motor_lag_s)
        return self.frame.allocation @ (coefficient * self.speeds**2)


def integrate(
    frame: Airframe, state: BodyState, wrench: np.ndarray, air: np.ndarray, dt: float
) -> BodyState:
    """The state after `dt` [s] under thrust [N], torque [N m] and the air's force [N], which stay as they are."""
    start = (state.position, state.velocity, state.rotation, state.body_rate)

    def slope(at: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        _, velocity, rotation, rate = at
        acceleration = (rotation[:, 2] * wrench[0] + air) / frame.mass - (0.0, 0.0, frame.gravity)
        return velocity, acceleration, rotation @ hat(rate), turning(frame.inertia, rate, wrench[1:])

    first = slope(start)
    second = slope(_moved(start, first, 0.5 * dt))
    third = slope(_moved(start, second, 0.5 * dt))
    fourth = slope(_moved(start, third, dt))
    mean = tuple((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(first, second, third, fourth, strict=True))
    position, velocity, rotation, rate = _moved(start, mean, dt)
    return BodyState(position, velocity, orthogonal(rotation), rate)


def turning(inertia: np.ndarray, body_rate: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """w' [rad/s^2], for the diagonal of J [kg m^2], w [rad/s] and tau [N m] in the body's axes."""
    return (torque - cross(body_rate, inertia * body_rate)) / inertia


def orthogonal(matrix: np.ndarray) -> np.ndarray:
    """The rotation next to a matrix that nearly is one (one step of Newton's iteration for the polar factor)."""
    return 0.5 * matrix @ (3 * np.eye(3) - matrix.T @ matrix)


def hat(vector: np.ndarray) -> np.ndarray:
    """The matrix of a cross product."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """np.cross of two vectors, which is ten times slower."""
    (a, b, c), (x, y, z) = one, other
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def rotation_of(vector: np.ndarray) -> np.ndarray:
    """Exp of a rotation vector [rad] (Rodrigues)."""
    angle, turn = float(np.sqrt(vector @ vector)), hat(vector)
    if angle < 1e-8:
        return np.eye(3) + turn
    return np.eye(3) + np.sin(angle) / angle * turn + (1 - np.cos(angle)) / angle**2 * turn @ turn


def _moved(start: tuple[np.ndarray, ...], slope: tuple[np.ndarray, ...], dt: float) -> tuple[np.ndarray, ...]:
    return tuple(value + dt * change for value, change in zip(start, slope, strict=True))
