"""Message types of ROS 2, and what messages of all kinds are made of."""

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.extras import from_extra
from nerfnav.geometry import picture_file

if TYPE_CHECKING:
    from rosbags.interfaces import Qos
    from rosbags.typesys.store import Typestore

_JPEG_QUALITY = 90
_FOREVER_S, _FOREVER_NS = 9223372036, 854775807


@cache
def typestore() -> "Typestore":
    """The message types of ROS 2 Humble, which later releases share."""
    typesys = from_extra("rosbags.typesys", "ros", "exporting ROS messages")
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)


def definition(message_type: str) -> str:
    """The definition of a message type and all that it is made of, in ROS 2's language."""
    return typestore().generate_msgdef(message_type, ros_version=2)[0]


def quality(latched: bool) -> "Qos":
    """Quality of service that is offered: reliable, and `latched` or not: whether it is kept for who comes later."""
    ros = from_extra("rosbags.interfaces", "ros", "exporting ROS messages")
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
    data = np.frombuffer(picture_file(picture.numpy(), _JPEG_QUALITY), np.uint8)
    return new("sensor_msgs/msg/CompressedImage", header, "jpeg", data)


def vector(values: list[float]) -> Any:
    """A geometry_msgs/Vector3."""
    return new("geometry_msgs/msg/Vector3", *values)


def pose_of(position: list[float], wxyz: list[float]) -> Any:
    """A geometry_msgs/Pose."""
    w, x, y, z = wxyz
    point, quaternion = new("geometry_msgs/msg/Point", *position), new("geometry_msgs/msg/Quaternion", x, y, z, w)
    return new("geometry_msgs/msg/Pose", point, quaternion)
