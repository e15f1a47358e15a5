"""TUM trajectories, which trajectory evaluation tools read: `timestamp tx ty tz qx qy qz qw`, one line for each row.

Times in s from the start, positions of the body in the world (ENU) in m, quaternion (x, y, z, w) of R_world_body.
"""

import torch

from nerfnav.export.recording import Exported, Recording

_HEAD = "# timestamp tx ty tz qx qy qz qw"


def tum(recording: Recording) -> Exported:
    """Export the poses of the subject."""
    poses = torch.cat([recording.position, recording.quaternion], -1)
    rows = torch.cat([recording.times[:, None], poses[:, :3], poses[:, 4:], poses[:, 3:4]], -1).tolist()
    lines = [" ".join(f"{value:.9g}" for value in row) for row in rows]
    return Exported("\n".join([_HEAD, f"# outcome: {recording.outcome or 'not known'}", *lines, ""]).encode())
