"""Track files: TUM's trajectory, a table with covariances, and ROS 2 messages in MCAP.

The texts are in any frame that is similar to the field's. The camera has OpenCV's axes there: x right, y down, z ahead.
Covariances are about the fixed axes of that frame. The messages are poses with covariances, the pictures and renderings
of the field:

    /about           std_msgs/String                            title and settings, as JSON
    /pose            geometry_msgs/PoseWithCovarianceStamped    of the camera, x right, y down, z ahead, in `map`
    /picture         sensor_msgs/CompressedImage                camera picture, JPEG
    /field_picture   sensor_msgs/CompressedImage                rendering of the field from the pose, JPEG

Stamps are the source's own times. `map` is the field's frame, z up; /pose comes only with frames whose picture
updated it.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.core.extras import import_extra
from nerfnav.export.ros_messages import WORLD, compressed, header, new, open_channel, pose_of, typestore
from nerfnav.export.tables import csv_lines
from nerfnav.geometry import Pose, Similarity, so3
from nerfnav.tracking import TrackedFrame

OPENCV = torch.diag(torch.tensor([1.0, -1.0, -1.0]))
"""R_opengl_opencv of a camera."""
_NAMES, _UNITS = ("x", "y", "z", "rx", "ry", "rz"), ("m", "m", "m", "rad", "rad", "rad")
_PAIRS = [(row, column) for row in range(6) for column in range(row, 6)]


def pose_in_frame(tracked: TrackedFrame, frame: Similarity) -> tuple[Pose, Float[Tensor, "6 6"]]:
    """T_frame_camera, in OpenCV's axes, and its covariance, where `frame` takes the field's coordinates there.

    Only for what has a pose.
    """
    pose, covariance = tracked.pose, tracked.covariance
    assert pose is not None and covariance is not None, "asked only of what was tracked"
    moved = frame.pose(Pose(pose.rotation.double(), pose.position.double()))
    turn = frame.rotation.double()
    change = torch.block_diag(frame.scale * turn, turn)
    return Pose(moved.rotation @ OPENCV.double(), moved.position), change @ covariance @ change.T


def texts_of_track(track: Sequence[TrackedFrame], placed: tuple[float, ...]) -> dict[str, str]:
    """Write the files of a track, by name, in the capture's own coordinates where the field knows them.

    `placed` is `FieldInfo.placed`.
    """
    frame = Similarity.of_numbers(placed).inverted() if placed else Similarity.identity()
    return {name: text_of(track, frame) for name, text_of in TRACK_FILES.items()}


def tum_of_track(track: Sequence[TrackedFrame], frame: Similarity) -> str:
    """Write `timestamp tx ty tz qx qy qz qw` for each frame whose picture updated the pose."""
    lines = [
        " ".join([f"{tracked.time:.6f}", *(f"{value:.9g}" for value in _numbers(tracked, frame)[0])])
        for tracked in track
        if tracked.status.updated
    ]
    return "\n".join(["# timestamp tx ty tz qx qy qz qw", *lines, ""])


def csv_of_track(track: Sequence[TrackedFrame], frame: Similarity) -> str:
    """Every frame: status, pose and the upper triangle of its covariance, empty where there is no pose."""
    pose = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"]
    covariances = [f"cov_{_NAMES[i]}_{_NAMES[j]}_{_UNITS[i]}.{_UNITS[j]}" for i, j in _PAIRS]
    table = [["time_s", "name", "status", *pose, *covariances, "difference", "ms"]]
    for tracked in track:
        row = [f"{tracked.time:.6f}", tracked.name, tracked.status.name.lower()]
        if tracked.status.knows:
            numbers, covariance = _numbers(tracked, frame)
            row += [f"{value:.9g}" for value in (*numbers, *(float(covariance[pair]) for pair in _PAIRS))]
        else:
            row += [""] * (len(pose) + len(_PAIRS))
        difference = "" if tracked.difference is None else f"{tracked.difference:.5f}"
        table.append([*row, difference, f"{tracked.ms:.2f}"])
    return csv_lines(table)


TRACK_FILES = {"trajectory.tum": tum_of_track, "poses.csv": csv_of_track}
"""Name of each file of a track, and the function that writes its text."""


def _numbers(tracked: TrackedFrame, frame: Similarity) -> tuple[list[float], Float[Tensor, "6 6"]]:
    """Position [m] and quaternion (x, y, z, w), and the covariance."""
    pose, covariance = pose_in_frame(tracked, frame)
    w, x, y, z = so3.quaternion_from_matrix(pose.rotation).tolist()
    return [*pose.position.tolist(), x, y, z, w], covariance


_TOPICS = {
    "/about": "std_msgs/msg/String",
    "/pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/picture": "sensor_msgs/msg/CompressedImage",
    "/field_picture": "sensor_msgs/msg/CompressedImage",
}
_CAMERA = "camera"


class TrackRecorder:
    """Writes an MCAP file, one frame after the other; a context manager."""

    def __init__(self, path: Path, about: dict[str, Any]) -> None:
        """Begin the file. Raises MissingExtraError without mcap and rosbags."""
        writer = import_extra("mcap.writer", "ros", "MCAP").Writer
        typestore()  # before a file is begun
        self._stream = path.open("wb")
        self._writer, self._about = writer(self._stream), about
        self._writer.start(profile="ros2", library="nerfnav")
        self._channels = {topic: open_channel(self._writer, topic, kind, {}) for topic, kind in _TOPICS.items()}
        self._empty = True

    def __enter__(self) -> "TrackRecorder":
        """Itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End the file."""
        self._writer.finish()
        self._stream.close()

    def add(
        self,
        tracked: TrackedFrame,
        picture: UInt8[Tensor, "height width 3"],
        shown: UInt8[Tensor, "height width 3"] | None,
    ) -> None:
        """Add a frame; `shown` is what the field shows, None where no pose is known."""
        nanoseconds = round(1e9 * tracked.time)
        if self._empty:
            self._write("/about", nanoseconds, new("std_msgs/msg/String", json.dumps(self._about)))
            self._empty = False
        self._write("/picture", nanoseconds, compressed(picture, header(nanoseconds, _CAMERA)))
        if shown is not None:
            self._write("/field_picture", nanoseconds, compressed(shown, header(nanoseconds, _CAMERA)))
        if tracked.status.updated:
            self._write("/pose", nanoseconds, _pose(nanoseconds, tracked))

    def _write(self, topic: str, nanoseconds: int, message: Any) -> None:
        content = bytes(typestore().serialize_cdr(message, _TOPICS[topic]))
        self._writer.add_message(self._channels[topic], max(0, nanoseconds), content, max(0, nanoseconds))


def _pose(nanoseconds: int, tracked: TrackedFrame) -> Any:
    pose, covariance = pose_in_frame(tracked, Similarity.identity())
    posed = pose_of(pose.position.tolist(), so3.quaternion_from_matrix(pose.rotation).tolist())
    with_covariance = new("geometry_msgs/msg/PoseWithCovariance", posed, covariance.numpy().reshape(-1))
    return new("geometry_msgs/msg/PoseWithCovarianceStamped", header(nanoseconds, WORLD), with_covariance)
