"""Autopilots: setpoints and odometry for PX4 and ArduPilot, as CSV with one row for each message.

Each column is a number of the message. The world is taken for NED (see nerfnav.export.setpoints), the body for FRD (x
forward, y right, z down). The first line is a comment that begins with #.

    px4             TrajectorySetpoint   for offboard mode; kinematically consistent at every row
    px4-odometry    VehicleOdometry      the robot's estimate on a flight, for the topic vehicle_visual_odometry
    ardupilot       SET_POSITION_TARGET_LOCAL_NED (84) of MAVLink, for guided mode

Columns of PX4 have the names of the fields of px4_msgs of PX4 1.16 and later (MESSAGE_VERSION 0 of both messages),
arrays as ulog2csv and pandas have them: position[0], position[1], ...

Columns of ArduPilot have the names of the message's fields. Frame MAV_FRAME_LOCAL_NED (1): positions count from the
origin of the vehicle's estimator, which must be that of the world, north along the world's y axis. Type mask 2048:
position, velocity, acceleration and yaw are used, the yaw rate is not.
"""

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.export.recording import Exported, Recording
from nerfnav.export.setpoints import RATE_HZ, csv_of, describe_setpoints, ned_of_enu, ned_rows, setpoints_of
from nerfnav.geometry import so3
from nerfnav.navigation import NavigationStep
from nerfnav.robots import ATTITUDE, POSITION, VELOCITY

MESSAGE_VERSION = 0
"""Of TrajectorySetpoint and of VehicleOdometry."""
_ARRAYS = ("position", "velocity", "acceleration", "jerk")
SETPOINT_COLUMNS = ("timestamp", *(f"{name}[{axis}]" for name in _ARRAYS for axis in range(3)), "yaw", "yawspeed")
"""Names of PX4's fields; the timestamp counts from the start [us]."""
_POSE_FRAME_NED = _VELOCITY_FRAME_NED = 1
_ODOMETRY_ARRAYS = {
    "position": 3, "q": 4, "velocity": 3, "angular_velocity": 3, "position_variance": 3, "orientation_variance": 3,
    "velocity_variance": 3,
}  # fmt: skip
ODOMETRY_COLUMNS = (
    "timestamp", "timestamp_sample", "pose_frame", "velocity_frame",
    *(f"{name}[{index}]" for name, size in _ODOMETRY_ARRAYS.items() for index in range(size)),
    "reset_counter", "quality",
)  # fmt: skip
"""The same for odometry."""
_FLIP = torch.diag(torch.tensor([1.0, -1.0, -1.0], dtype=torch.float64))
_NED_OF_ENU = torch.tensor([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]], dtype=torch.float64)
TYPE_MASK, _LOCAL_NED = 2048, 1
ARDUPILOT_COLUMNS = (
    "time_boot_ms", "coordinate_frame", "type_mask", "x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz", "yaw",
    "yaw_rate",
)  # fmt: skip
"""Names of the message's fields; the time counts from the start [ms]."""


def px4(recording: Recording) -> Exported:
    """Export setpoints along the smooth curve of the subject."""
    curve, times = setpoints_of(recording)
    rows = ned_rows(curve, times)
    table = [times[:, None], *(rows[name] for name in _ARRAYS), rows["yaw"][:, None], rows["yawspeed"][:, None]]
    comment = (
        f"px4_msgs/msg/TrajectorySetpoint, MESSAGE_VERSION {MESSAGE_VERSION}; NED from the origin of the world; "
        f"{RATE_HZ} Hz; of {curve.motion}; {_ending(recording)}"
    )
    info = {"message_version": MESSAGE_VERSION, **describe_setpoints(recording, curve)}
    return Exported(csv_of(comment, SETPOINT_COLUMNS, np.concatenate(table, -1).tolist()), info, curve.shape)


def px4_odometry(recording: Recording) -> Exported:
    """Export the robot's estimate with variances, as vision for PX4's estimator.

    Raises InvalidInputError for a plan.
    """
    if not recording.steps:
        raise InvalidInputError("a plan has no estimate: export it as px4, or fly it first")
    comment = (
        f"px4_msgs/msg/VehicleOdometry, MESSAGE_VERSION {MESSAGE_VERSION}, for the topic vehicle_visual_odometry; "
        f"pose and velocity in NED, body in FRD; what the robot believed; {_ending(recording)}"
    )
    content = csv_of(comment, ODOMETRY_COLUMNS, map(_odometry, recording.steps))
    return Exported(content, {"message_version": MESSAGE_VERSION, "frame": "NED"})


def ardupilot(recording: Recording) -> Exported:
    """Export setpoints along the smooth curve of the subject."""
    curve, times = setpoints_of(recording)
    times = np.append(times[:-1], -(-times[-1] // 1000) * 1000)  # the message counts whole milliseconds
    rows = ned_rows(curve, times)
    fixed = np.tile([_LOCAL_NED, TYPE_MASK], (len(times), 1))
    vectors = [rows[name] for name in ("position", "velocity", "acceleration")]
    table = [times[:, None] // 1000, fixed, *vectors, rows["yaw"][:, None], rows["yawspeed"][:, None]]
    comment = (
        f"MAVLink SET_POSITION_TARGET_LOCAL_NED; coordinate_frame {_LOCAL_NED} (MAV_FRAME_LOCAL_NED), origin of the "
        f"estimator at the origin of the world; type_mask {TYPE_MASK} (all but yaw_rate); {RATE_HZ} Hz; "
        f"of {curve.motion}; {_ending(recording)}"
    )
    info = {"type_mask": TYPE_MASK, "origin": "the world's", **describe_setpoints(recording, curve)}
    return Exported(csv_of(comment, ARDUPILOT_COLUMNS, np.concatenate(table, -1).tolist()), info, curve.shape)


def _odometry(step: NavigationStep) -> list[float]:
    mean, variance = step.belief.mean, step.belief.covariance.double().diagonal().clamp_min(0)
    time_us = round(step.time * 10**6)
    quaternion = so3.quaternion_from_matrix(_NED_OF_ENU @ mean.rotation.double() @ _FLIP)
    swapped = torch.tensor([1, 0, 2])  # the variances of north and east; those of up and down are one
    numbers = torch.cat([
        ned_of_enu(mean.position.double()),
        quaternion * (1.0 if quaternion[0] >= 0 else -1.0),
        ned_of_enu(mean.velocity.double()),
        _FLIP @ mean.body_rate.double(),
        variance[POSITION][swapped],
        variance[ATTITUDE],  # about the body's axes, as the belief has it
        variance[VELOCITY][swapped],
    ])  # fmt: skip
    return [time_us, time_us, _POSE_FRAME_NED, _VELOCITY_FRAME_NED, *numbers.tolist(), 0, 0]


def _ending(recording: Recording) -> str:
    return f"outcome: {recording.outcome or 'not known'}"
