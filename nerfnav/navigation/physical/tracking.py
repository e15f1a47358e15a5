"""Geometric tracking of a discrete plan on SE(3), between the time steps of the loop.

The plan's states are h apart. Its attitude and body rate are met exactly at both ends of a step by

    w(t) = w_k + (w_{k+1} - w_k) (3 r^2 - 2 r),   R(t) = R_k Exp( w_k t + (w_{k+1} - w_k) (r^3 - r^2) h ),   r = t / h

and the wished acceleration is the one that its thrust f_k has in these attitudes, with feedback of position and
velocity. Attitude errors are fed back as in T. Lee, M. Leok and N. H. McClamroch, "Geometric tracking control of a
quadrotor UAV on SE(3)", 2010. The accelerometer corrects the thrust for a wrong mass, as in E. Tal and S. Karaman,
"Accurate tracking of aggressive quadrotor trajectories using incremental nonlinear dynamic inversion and differential
flatness", 2021, along the body's z axis alone.
"""

from dataclasses import dataclass

import numpy as np

from nerfnav.navigation.physical.rigid_body import BodyState, cross, hat, rotation_of
from nerfnav.robots import Motion

_UPRIGHT = 1e-6


@dataclass(frozen=True)
class TrackingGains:
    """How strongly errors are fed back."""

    position: float = 16.0
    """Acceleration for a metre [1/s^2]."""
    velocity: float = 6.0
    """Acceleration for a metre a second [1/s]."""
    attitude: float = 500.0
    """Angular acceleration for a radian [1/s^2]."""
    body_rate: float = 40.0
    """Angular acceleration for a radian a second [1/s]."""
    lead: float = 2.5
    """How many times a rotor's missing speed is asked of its motor, which follows with a lag."""
    lift: float = 20.0
    """Rate at which the accelerometer corrects the thrust [1/s]."""


@dataclass(frozen=True)
class Reference:
    """One step of a plan, between its time steps."""

    start: BodyState
    """At the beginning."""
    end_rate: np.ndarray
    """Body rate at the end [rad/s]."""
    pull: float
    """Thrust for each kg [m/s^2]."""
    dt: float
    """Length of the step [s]."""

    @classmethod
    def of(cls, plan: Motion, mass: float) -> "Reference":
        """The first step of a plan for a robot of a mass [kg]."""
        states, actions = plan.states.detach(), plan.actions.detach()
        rates = states.body_rate[:2].double().numpy()
        start = BodyState(
            states.position[0].double().numpy(), states.velocity[0].double().numpy(),
            states.rotation[0].double().numpy(), rates[0],
        )  # fmt: skip
        return cls(start, rates[-1], float(actions[0, 0]) / mass, plan.dt)

    def attitude(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """R, w and its derivative at a time of the step, 0 to `dt` [s]."""
        rate, change, share = self.start.body_rate, self.end_rate - self.start.body_rate, time / self.dt
        turned = rate * time + change * (share**3 - share**2) * self.dt
        spin = rate + change * (3 * share - 2) * share
        return self.start.rotation @ rotation_of(turned), spin, change * (6 * share - 2) / self.dt


@dataclass(frozen=True)
class Wanted:
    """What the robot should do at one time."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    """Without gravity: what the thrust should give [m/s^2]."""
    rotation: np.ndarray
    body_rate: np.ndarray
    turning: np.ndarray
    """Angular acceleration [rad/s^2]."""


def wrench_for(
    wanted: Wanted, believed: BodyState, inertia: np.ndarray, gains: TrackingGains
) -> np.ndarray:
    """Thrust for each kg [m/s^2] and torque [N m] that lead from the believed state to the wanted one."""
    pull = wanted.acceleration + gains.position * (wanted.position - believed.position)
    pull = pull + gains.velocity * (wanted.velocity - believed.velocity)
    rotation = tilted(wanted.rotation, pull)
    between = rotation.T @ believed.rotation
    off = 0.5 * (between - between.T)
    attitude = np.array([off[2, 1], off[0, 2], off[1, 0]])
    rate = believed.body_rate - between.T @ wanted.body_rate
    turning = between.T @ wanted.turning - gains.attitude * attitude - gains.body_rate * rate
    torque = inertia * turning + cross(believed.body_rate, inertia * believed.body_rate)
    return np.array([max(0.0, float(pull @ believed.rotation[:, 2])), *torque])


def tilted(rotation: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """The attitude turned by the least angle that takes its z axis to a direction; as it is for no direction."""
    length = float(np.sqrt(pull @ pull))
    axis = rotation[:, 2]
    cosine = float(axis @ pull) / max(length, _UPRIGHT)
    if length < _UPRIGHT or cosine < -1 + _UPRIGHT:
        return rotation
    turn = cross(axis, pull / length)
    skew = hat(turn)
    return (np.eye(3) + skew + skew @ skew / (1 + cosine)) @ rotation
