"""Setpoints for ArduPilot's guided mode, as CSV: one row for each MAVLink SET_POSITION_TARGET_LOCAL_NED (84).

The columns have the names of the message's fields. Frame MAV_FRAME_LOCAL_NED (1): positions count from the origin of
the vehicle's estimator, which must be that of the world, north along the world's y axis. Type mask 2048: position,
velocity, acceleration and yaw are to be used, the yaw rate is not.
"""

import numpy as np

from nerfnav.export.recording import Exported, Recording
from nerfnav.export.setpoints import RATE_HZ, csv_of, describe_setpoints, ned_rows, setpoints_of

TYPE_MASK, _LOCAL_NED = 2048, 1
COLUMNS = (
    "time_boot_ms", "coordinate_frame", "type_mask", "x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz", "yaw",
    "yaw_rate",
)  # fmt: skip
"""Names of the message's fields; the time counts from the start [ms]."""


def ardupilot(recording: Recording) -> Exported:
    """Setpoints along the smooth curve of a plan or a flight."""
    curve, times = setpoints_of(recording)
    times = np.append(times[:-1], -(-times[-1] // 1000) * 1000)  # the message counts whole milliseconds
    rows = ned_rows(curve, times)
    fixed = np.tile([_LOCAL_NED, TYPE_MASK], (len(times), 1))
    vectors = [rows[name] for name in ("position", "velocity", "acceleration")]
    table = [times[:, None] // 1000, fixed, *vectors, rows["yaw"][:, None], rows["yawspeed"][:, None]]
    comment = (
        f"MAVLink SET_POSITION_TARGET_LOCAL_NED; coordinate_frame {_LOCAL_NED} (MAV_FRAME_LOCAL_NED), origin of the "
        f"estimator at the origin of the world; type_mask {TYPE_MASK} (all but yaw_rate); {RATE_HZ} Hz; "
        f"of {curve.motion}; outcome: {recording.outcome or 'not known'}"
    )
    content = csv_of(comment, COLUMNS, np.concatenate(table, -1).tolist())
    return Exported(
        content, {"type_mask": TYPE_MASK, "origin": "the world's", **describe_setpoints(recording, curve)}, curve.shape
    )
