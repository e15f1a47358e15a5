"""ROS 2 messages of a plan, an executed path or an estimate, and the message types and parts that all messages share.

Axes are those of ROS (REP 103): world ENU, body FLU, so nothing is turned. Quaternions are (x, y, z, w). Stamps count
from the start, 0 s.

    /about       std_msgs/String                        title, outcome and meaning of the numbers, as JSON
    /path        nav_msgs/Path                          all poses at once, at the start
    /odometry    nav_msgs/Odometry                      pose in `map`, velocities in the axes of `base_link`
    /tf          tf2_msgs/TFMessage                     the same pose as the transform from `map` to `base_link`
    /estimate    geometry_msgs/PoseWithCovarianceStamped   of a flight: the robot's estimate with its covariance
    /picture     sensor_msgs/CompressedImage            of a flight: the camera's picture, JPEG

/about and /path come once, latched: their durability is transient_local. The odometry of an executed path is the true
state in the simulation, that of a plan the planned one: both are exact, so their covariance is zero. That of an
estimate has the covariance of the belief.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.extras import import_extra
from nerfnav.export.recording import Recording, Subject
from nerfnav.geometry import encode_image, so3
from nerfnav.navigation import NavigationStep
from nerfnav.robots import ATTITUDE, POSITION

if TYPE_CHECKING:
    from rosbags.interfaces import Qos
    from rosbags.typesys.store import Typestore


_JPEG_QUALITY = 90
_FOREVER_S, _FOREVER_NS = 9223372036, 854775807


@cache
def typestore() -> "Typestore":
    """The message types of ROS 2 Humble, which later releases share."""
    typesys = import_extra("rosbags.typesys", "ros", "exporting ROS messages")
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)


def open_channel(writer: Any, topic: str, message_type: str, metadata: dict[str, str]) -> int:
    """Register a topic with an MCAP writer, with the definition of its messages; returns the channel's number."""
    definition = typestore().generate_msgdef(message_type, ros_version=2)[0]
    schema = writer.register_schema(message_type, "ros2msg", definition.encode())
    return writer.register_channel(topic, "cdr", schema, metadata)


def quality(latched: bool) -> "Qos":
    """Quality of service that is offered: reliable, and `latched` for late subscribers or not."""
    ros = import_extra("rosbags.interfaces", "ros", "exporting ROS messages")
    durability = ros.QosDurability.TRANSIENT_LOCAL if latched else ros.QosDurability.VOLATILE
    for_ever, depth = ros.QosTime(_FOREVER_S, _FOREVER_NS), 1 if latched else 10
    return ros.Qos(
        ros.QosHistory.KEEP_LAST, depth, ros.QosReliability.RELIABLE, durability, for_ever, for_ever,
        ros.QosLiveliness.AUTOMATIC, for_ever, False,
    )  # fmt: skip


def new(name: str, *values: Any) -> Any:
    """A message of a type, of the values of its fields in order."""
    return typestore().types[name](*values)


def header(nanoseconds: int, frame: str) -> Any:
    """A std_msgs/Header at a time [ns]."""
    stamp = new("builtin_interfaces/msg/Time", nanoseconds // 10**9, nanoseconds % 10**9)
    return new("std_msgs/msg/Header", stamp, frame)


def compressed(picture: UInt8[Tensor, "height width 3"], header: Any) -> Any:
    """A picture as sensor_msgs/CompressedImage."""
    data = np.frombuffer(encode_image(picture.numpy(), _JPEG_QUALITY), np.uint8)
    return new("sensor_msgs/msg/CompressedImage", header, "jpeg", data)


def vector(values: list[float]) -> Any:
    """Make a geometry_msgs/Vector3 message."""
    return new("geometry_msgs/msg/Vector3", *values)


def pose_of(position: list[float], wxyz: list[float]) -> Any:
    """Make a geometry_msgs/Pose message."""
    w, x, y, z = wxyz
    point, quaternion = new("geometry_msgs/msg/Point", *position), new("geometry_msgs/msg/Quaternion", x, y, z, w)
    return new("geometry_msgs/msg/Pose", point, quaternion)


WORLD, BODY = "map", "base_link"
"""Frames."""
TOPICS = {
    "/about": "std_msgs/msg/String",
    "/path": "nav_msgs/msg/Path",
    "/odometry": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/estimate": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/picture": "sensor_msgs/msg/CompressedImage",
}
"""Message type of each topic."""
_OF_FLIGHTS = ("/estimate", "/picture")
LATCHED = ("/about", "/path")
"""Topics that are published once and kept for late subscribers."""


_ESTIMATED = "the estimate: its pose has the covariance of the belief, its twist has none"


@dataclass(frozen=True)
class RosMessage:
    """One message, ready to be written."""

    topic: str
    """A key of TOPICS."""
    time_ns: int
    """From the start [ns]."""
    content: bytes
    """In CDR, the encoding of ROS 2."""


def topics(recording: Recording) -> dict[str, str]:
    """Topics of a recording and their message types; plans have neither an estimate nor pictures."""
    return {topic: kind for topic, kind in TOPICS.items() if recording.steps or topic not in _OF_FLIGHTS}


def about(recording: Recording) -> dict[str, str]:
    """Metadata of a recording for readers of its messages."""
    exact = "the true state in the simulation" if recording.subject is Subject.EXECUTED else "the plan"
    estimates = recording.subject is Subject.ESTIMATE
    return {
        "made by": "nerfnav",
        "title": recording.title,
        "robot": str(recording.table.info.get("robot", "")),
        "outcome": recording.outcome or "not known",
        "odometry": _ESTIMATED if estimates else f"{exact}, exact: its covariance is zero, not unknown",
    }


def messages(recording: Recording) -> Iterator[RosMessage]:
    """All messages in the order of their times."""
    made = _Maker(recording)
    yield made.message("/about", 0, new("std_msgs/msg/String", json.dumps(about(recording))))
    yield made.message("/path", 0, made.path())
    for row in range(len(recording.times)):
        yield made.message("/odometry", row, made.odometry(row))
        yield made.message("/tf", row, made.transform(row))
        if recording.steps:
            yield made.message("/estimate", row, made.estimate(row))
            seen = recording.steps[row].image
            if seen is not None:
                yield made.message("/picture", row, compressed(seen, made.header(row, BODY)))


class _Maker:
    """Makes messages of the rows of a recording."""

    def __init__(self, recording: Recording) -> None:
        self._times = recording.times.tolist()
        self._position, self._quaternion = recording.position.tolist(), recording.quaternion.tolist()
        rotation = so3.matrix_from_quaternion(recording.quaternion)
        self._velocity_body = (recording.velocity[:, None] @ rotation)[:, 0].tolist()
        self._rate = recording.body_rate.tolist()
        self._estimates = [] if recording.estimated_poses is None else recording.estimated_poses.tolist()
        self._steps, self._estimated = recording.steps, recording.subject is Subject.ESTIMATE

    def message(self, topic: str, row: int, content: Any) -> RosMessage:
        cdr = bytes(typestore().serialize_cdr(content, TOPICS[topic]))
        return RosMessage(topic, round(1e9 * self._times[row]), cdr)

    def path(self) -> Any:
        rows = range(len(self._times))
        poses = [new("geometry_msgs/msg/PoseStamped", self.header(row), self._pose(row)) for row in rows]
        return new("nav_msgs/msg/Path", self.header(0), poses)

    def odometry(self, row: int) -> Any:
        exact = np.zeros(36)
        covariance = pose_covariance(self._steps[row]) if self._estimated else exact
        twist = new("geometry_msgs/msg/Twist", vector(self._velocity_body[row]), vector(self._rate[row]))
        return new(
            "nav_msgs/msg/Odometry",
            self.header(row),
            BODY,
            new("geometry_msgs/msg/PoseWithCovariance", self._pose(row), covariance),
            new("geometry_msgs/msg/TwistWithCovariance", twist, exact),
        )

    def transform(self, row: int) -> Any:
        pose = self._pose(row)
        moved = vector([pose.position.x, pose.position.y, pose.position.z])
        transform = new("geometry_msgs/msg/Transform", moved, pose.orientation)
        stamped = new("geometry_msgs/msg/TransformStamped", self.header(row), BODY, transform)
        return new("tf2_msgs/msg/TFMessage", [stamped])

    def estimate(self, row: int) -> Any:
        estimated = self._estimates[row]  # whose quaternions have no sign flips
        covariance = pose_covariance(self._steps[row])
        pose = new("geometry_msgs/msg/PoseWithCovariance", pose_of(estimated[:3], estimated[3:]), covariance)
        return new("geometry_msgs/msg/PoseWithCovarianceStamped", self.header(row), pose)

    def header(self, row: int, frame: str = WORLD) -> Any:
        return header(round(1e9 * self._times[row]), frame)

    def _pose(self, row: int) -> Any:
        return pose_of(self._position[row], self._quaternion[row])


def pose_covariance(step: NavigationStep) -> np.ndarray:
    """Covariance of position [m] and attitude [rad] about fixed world axes, 36 numbers row by row.

    The belief's attitude error is in the body, R Exp(dtheta); about world axes it is R dtheta.
    """
    picked = [*range(12)[POSITION], *range(12)[ATTITUDE]]
    covariance = step.belief.covariance.double()[picked][:, picked]
    turn = torch.eye(6, dtype=torch.float64)
    turn[3:, 3:] = step.belief.mean.rotation.double()
    return (turn @ covariance @ turn.T).numpy().reshape(-1)
