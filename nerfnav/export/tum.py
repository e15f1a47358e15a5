"""TUM trajectories, which trajectory evaluation tools read: `timestamp tx ty tz qx qy qz qw`, one line for each row.

Times in s from the start, positions of the body in the world (ENU) in m, quaternion (x, y, z, w) of R_world_body.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.export.recording import Exported, Recording

_HEAD = "# timestamp tx ty tz qx qy qz qw"


def tum(recording: Recording) -> Exported:
    """Export the true path of a flight, or the plan."""
    return _text(recording, torch.cat([recording.position, recording.quaternion], -1))


def tum_estimate(recording: Recording) -> Exported:
    """Export the estimated path, to be compared with `tum`. Raises InvalidInputError for a plan."""
    if recording.estimated_poses is None:
        raise InvalidInputError("a plan has no estimate: export it as tum, or fly it first")
    return _text(recording, recording.estimated_poses)


def _text(recording: Recording, poses: Float[Tensor, "rows 7"]) -> Exported:
    rows = torch.cat([recording.times[:, None], poses[:, :3], poses[:, 4:], poses[:, 3:4]], -1).tolist()
    lines = [" ".join(f"{value:.9g}" for value in row) for row in rows]
    return Exported("\n".join([_HEAD, f"# outcome: {recording.outcome or 'not known'}", *lines, ""]).encode())
