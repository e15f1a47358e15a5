"""A track as ROS 2 messages in MCAP: poses with covariances, the pictures and what the field shows.

    /about           std_msgs/String                            what this is, as JSON
    /pose            geometry_msgs/PoseWithCovarianceStamped    of the camera, x right, y down, z ahead, in `map`
    /picture         sensor_msgs/CompressedImage                what was seen, JPEG
    /field_picture   sensor_msgs/CompressedImage                what the field shows from the pose, JPEG

Stamps are the source's own times. `map` is the field's frame, z up; /pose comes only with frames whose picture told it.
"""

import json
from pathlib import Path
from types import TracebackType
from typing import Any

from jaxtyping import UInt8
from torch import Tensor

from nerfnav.export.ros.messages import WORLD
from nerfnav.export.ros.types import compressed, definition, header, new, pose_of, typestore
from nerfnav.export.track import placed
from nerfnav.extras import from_extra
from nerfnav.geometry import Similarity, so3
from nerfnav.tracking import Tracked

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
        writer = from_extra("mcap.writer", "ros", "MCAP").Writer
        typestore()  # before a file is begun
        self._stream = path.open("wb")
        self._writer, self._about = writer(self._stream), about
        self._writer.start(profile="ros2", library="nerfnav")
        self._channels = {topic: self._channel(topic, kind) for topic, kind in _TOPICS.items()}
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
        tracked: Tracked,
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

    def _channel(self, topic: str, kind: str) -> int:
        schema = self._writer.register_schema(kind, "ros2msg", definition(kind).encode())
        return self._writer.register_channel(topic, "cdr", schema)

    def _write(self, topic: str, nanoseconds: int, message: Any) -> None:
        content = bytes(typestore().serialize_cdr(message, _TOPICS[topic]))
        self._writer.add_message(self._channels[topic], max(0, nanoseconds), content, max(0, nanoseconds))


def _pose(nanoseconds: int, tracked: Tracked) -> Any:
    pose, covariance = placed(tracked, Similarity.identity())
    posed = pose_of(pose.position.tolist(), so3.quaternion_from_matrix(pose.rotation).tolist())
    with_covariance = new("geometry_msgs/msg/PoseWithCovariance", posed, covariance.numpy().reshape(-1))
    return new("geometry_msgs/msg/PoseWithCovarianceStamped", header(nanoseconds, WORLD), with_covariance)
