"""Geometric controller on SE(3) with a disturbance observer.

    a = a_ref + k_p (p_ref - p) + k_v (v_ref - v) - d

is the acceleration that the thrust should give, and attitude errors are fed back as in T. Lee, M. Leok and N. H.
McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", 2010. The disturbance d is what the
accelerometers feel beyond the thrust that the rotors should give: drag, wind and a wrong mass. To correct for it is
incremental nonlinear dynamic inversion: E. Tal and S. Karaman, "Accurate tracking of aggressive quadrotor
trajectories using incremental nonlinear dynamic inversion and differential flatness", 2021.
"""

from dataclasses import dataclass

import numpy as np

from nerfnav.navigation.physical.reference_trajectory import ReferenceState
from nerfnav.navigation.physical.rigid_body import BodyState, cross, hat

_UPRIGHT = 1e-6


@dataclass(frozen=True)
class TrackingGains:
    """Gains of the geometric controller."""

    position: float = 36.0
    """Acceleration for a metre [1/s^2]."""
    velocity: float = 11.0
    """Acceleration for a metre a second [1/s]."""
    attitude: float = 900.0
    """Angular acceleration for a radian [1/s^2]."""
    body_rate: float = 55.0
    """Angular acceleration for a radian a second [1/s]."""
    lead: float = 2.5
    """Factor on the missing speed of a rotor in the command of its motor, which follows with a lag."""
    observer: float = 20.0
    """Rate at which the disturbance follows what the accelerometers feel [1/s]."""
    least_thrust: float = 0.5
    """Least share of the planned thrust that corrections leave."""
    lean: float = 0.4
    """Largest sideways correction of the thrust, relative to the thrust along the planned one: 22 degrees."""


def compute_wrench(
    reference: ReferenceState, believed: BodyState, disturbance: np.ndarray, inertia: np.ndarray, gains: TrackingGains
) -> np.ndarray:
    """Compute the thrust for each kg [m/s^2] and the torque [N m] that lead from the believed state to the reference.

    `disturbance` is d, in the world [m/s^2].
    """
    correction = gains.position * (reference.position - believed.position) - disturbance
    correction = correction + gains.velocity * (reference.velocity - believed.velocity)
    pull = correct_thrust(reference.acceleration, correction, gains)
    rotation = tilt_attitude(reference.rotation, pull)
    between = rotation.T @ believed.rotation
    off = 0.5 * (between - between.T)
    attitude = np.array([off[2, 1], off[0, 2], off[1, 0]])
    rate = believed.body_rate - between.T @ reference.body_rate
    turning = between.T @ reference.turning - gains.attitude * attitude - gains.body_rate * rate
    torque = inertia * turning + cross(believed.body_rate, inertia * believed.body_rate)
    return np.array([max(0.0, float(pull @ believed.rotation[:, 2])), *torque])


def correct_thrust(pull: np.ndarray, correction: np.ndarray, gains: TrackingGains) -> np.ndarray:
    """Add a correction to a planned thrust, without the part that would turn the thrust over.

    Where a plan lets a robot fall it has little thrust, and a correction of a robot that falls too slowly would turn it
    upside down to push it down.
    """
    length = float(np.sqrt(pull @ pull))
    if length < _UPRIGHT:
        return pull + correction
    axis = pull / length
    along = float(axis @ correction)
    across = correction - along * axis
    kept = max(length + along, gains.least_thrust * length)
    sideways = float(np.sqrt(across @ across))
    return kept * axis + across * min(1.0, gains.lean * kept / max(sideways, _UPRIGHT))


def tilt_attitude(rotation: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """Turn an attitude by the least angle that takes its z axis to a direction; keep it where there is none."""
    length = float(np.sqrt(pull @ pull))
    axis = rotation[:, 2]
    cosine = float(axis @ pull) / max(length, _UPRIGHT)
    if length < _UPRIGHT or cosine < -1 + _UPRIGHT:
        return rotation
    skew = hat(cross(axis, pull / length))
    return (np.eye(3) + skew + skew @ skew / (1 + cosine)) @ rotation
