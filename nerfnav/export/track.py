"""A track as text: TUM's trajectory and a table with covariances, in any frame that lies like the field's.

The camera has OpenCV's axes here: x right, y down, z ahead. Covariances are about the fixed axes of that frame.
"""

import csv
import io
from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import Pose, Similarity, so3
from nerfnav.tracking import Tracked

OPENCV = torch.diag(torch.tensor([1.0, -1.0, -1.0]))
"""R_opengl_opencv of a camera."""
_NAMES, _UNITS = ("x", "y", "z", "rx", "ry", "rz"), ("m", "m", "m", "rad", "rad", "rad")
_PAIRS = [(row, column) for row in range(6) for column in range(row, 6)]


def placed(tracked: Tracked, frame: Similarity) -> tuple[Pose, Float[Tensor, "6 6"]]:
    """T_frame_camera, in OpenCV's axes, and its covariance, where `frame` takes the field's coordinates there.

    Only for what has a pose.
    """
    pose, covariance = tracked.pose, tracked.covariance
    assert pose is not None and covariance is not None, "asked only of what was tracked"
    moved = frame.pose(Pose(pose.rotation.double(), pose.position.double()))
    turn = frame.rotation.double()
    change = torch.block_diag(frame.scale * turn, turn)
    return Pose(moved.rotation @ OPENCV.double(), moved.position), change @ covariance @ change.T


def texts_of_track(track: Sequence[Tracked], placed: tuple[float, ...]) -> dict[str, str]:
    """Name and text of each file that tells a track, in the capture's own coordinates where the field knows them.

    `placed` is `FieldInfo.placed`.
    """
    frame = Similarity.of_numbers(placed).inverted() if placed else Similarity.identity()
    return {name: text_of(track, frame) for name, text_of in TRACK_FILES.items()}


def tum_of_track(track: Sequence[Tracked], frame: Similarity) -> str:
    """`timestamp tx ty tz qx qy qz qw` of each frame whose picture told the pose."""
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for tracked in track:
        if tracked.status.updated:
            lines.append(" ".join([f"{tracked.time:.6f}", *(f"{value:.9g}" for value in _numbers(tracked, frame)[0])]))
    return "\n".join(lines) + "\n"


def csv_of_track(track: Sequence[Tracked], frame: Similarity) -> str:
    """Every frame: status, pose and the upper triangle of its covariance, empty where there is no pose."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    pose = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"]
    table.writerow(["time_s", "name", "status", *pose, *map(_heading, _PAIRS), "difference", "ms"])
    for tracked in track:
        row = [f"{tracked.time:.6f}", tracked.name, tracked.status.name.lower()]
        if tracked.status.knows:
            numbers, covariance = _numbers(tracked, frame)
            row += [f"{value:.9g}" for value in (*numbers, *(float(covariance[pair]) for pair in _PAIRS))]
        else:
            row += [""] * (len(pose) + len(_PAIRS))
        difference = "" if tracked.difference is None else f"{tracked.difference:.5f}"
        table.writerow([*row, difference, f"{tracked.ms:.2f}"])
    return text.getvalue()


TRACK_FILES = {"trajectory.tum": tum_of_track, "poses.csv": csv_of_track}
"""Name of each file that tells a track, and what makes its text."""


def _heading(pair: tuple[int, int]) -> str:
    row, column = pair
    return f"cov_{_NAMES[row]}_{_NAMES[column]}_{_UNITS[row]}.{_UNITS[column]}"


def _numbers(tracked: Tracked, frame: Similarity) -> tuple[list[float], Float[Tensor, "6 6"]]:
    """Position [m] and quaternion (x, y, z, w), and the covariance."""
    pose, covariance = placed(tracked, frame)
    w, x, y, z = so3.quaternion_from_matrix(pose.rotation).tolist()
    return [*pose.position.tolist(), x, y, z, w], covariance
