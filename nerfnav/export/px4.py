"""Setpoints for PX4's offboard mode, as CSV: one row for each `TrajectorySetpoint` message.

PX4 works in local NED axes (x north, y east, z down) and measures headings clockwise from north; the library works
in ENU (x east, y north, z up), headings counter-clockwise from east. So

    (north, east, down) = (y, x, -z)        yaw_ned = pi / 2 - yaw_enu, wrapped to (-pi, pi]

for positions [m], velocities [m/s] and accelerations [m/s^2] alike; the origin is that of the world, so the local
frame of the vehicle must have its origin there. The acceleration is the one of the step that begins at the row.
"""

import csv
import io

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.export.recording import Exported, Recording

COLUMNS = ("t", "x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az", "yaw")
"""Names of PX4's fields; t is the time from the start [s]."""


def px4(recording: Recording) -> Exported:
    """The states as setpoints."""
    columns = [recording.times[:, None]]
    columns += [ned_of_enu(part) for part in (recording.position, recording.velocity, recording.acceleration())]
    rows = torch.cat([*columns, yaw_ned_of_enu(recording.yaw())[:, None]], -1).tolist()
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([f"{value:.9g}" for value in row] for row in rows)
    return Exported(stream.getvalue().encode(), {"frame": "NED"})


def ned_of_enu(vectors: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
    """(x, y, z) in ENU as (north, east, down); its own inverse."""
    return torch.stack([vectors[..., 1], vectors[..., 0], -vectors[..., 2]], -1)


def yaw_ned_of_enu(yaw: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """A heading counter-clockwise from east as one clockwise from north, in (-pi, pi] [rad]; its own inverse."""
    turned = torch.pi / 2 - yaw
    return turned - 2 * torch.pi * torch.ceil((turned - torch.pi) / (2 * torch.pi))
