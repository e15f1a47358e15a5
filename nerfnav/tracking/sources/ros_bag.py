"""ROS 2 recordings: MCAP files, and rosbag2 in SQLite or MCAP.

Read are sensor_msgs/Image or CompressedImage, CameraInfo of the same namespace and Imu, and in /tf_static how the
camera is mounted on the inertial measurement unit. A message's time is that of its header, or, where its header has
none, that of the recording.

In this order: static frames (/tf_static), pictures and cameras of messages, topics and their messages, the source.
"""

import reprlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import takewhile
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.extras import import_extra
from nerfnav.formats import parse_camera
from nerfnav.geometry import Camera, Pose, so3
from nerfnav.tracking.frame import Frame, ImuMeasurements, mount_of
from nerfnav.tracking.sources.pictures import GREY, decode_picture, require_later

Tree = dict[str, tuple[str, np.ndarray]]
"""Of each frame, its parent and T_parent_frame (4, 4)."""


def tree_of(messages: Iterable[Any]) -> Tree:
    """The tree of all tf2_msgs/TFMessage."""
    return {
        given.child_frame_id: (given.header.frame_id, _matrix(given.transform))
        for message in messages
        for given in message.transforms
    }


def between(tree: Tree, frame: str, other: str) -> np.ndarray | None:
    """T_frame_other (4, 4); None where no way leads from one to the other."""
    ways = [_from_root(tree, name) for name in (frame, other)]
    if ways[0] is None or ways[1] is None or ways[0][0] != ways[1][0]:
        return None
    return np.linalg.inv(ways[0][1]) @ ways[1][1]


def _from_root(tree: Tree, frame: str) -> tuple[str, np.ndarray] | None:
    """The root above a frame, and T_root_frame; None where frames are above themselves."""
    at = np.eye(4)
    for _ in range(len(tree) + 1):
        if frame not in tree:
            return frame, at
        frame, above = tree[frame]
        at = above @ at
    return None


def _matrix(transform: Any) -> np.ndarray:
    turn, shift = transform.rotation, transform.translation
    matrix = np.eye(4)
    quaternion = torch.tensor([turn.w, turn.x, turn.y, turn.z], dtype=torch.float64)
    matrix[:3, :3], matrix[:3, 3] = so3.matrix_from_quaternion(quaternion).numpy(), (shift.x, shift.y, shift.z)
    return matrix


IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
"""Message types that hold pictures."""
_ORDERS = {"rgb8": (0, 1, 2), "bgr8": (2, 1, 0), "rgba8": (0, 1, 2), "bgra8": (2, 1, 0)}
"""Where red, green and blue stand in the pixels of an encoding."""
_GREY = ("mono8", "8UC1", "mono16", "16UC1")
_RECTIFIED = "image_rect"


def decode_image_message(message: Any, aspect: float | None = None) -> UInt8[Tensor, "height width 3"]:
    """The picture of an Image or CompressedImage, RGB; `aspect` as `decode_picture` has it.

    Grey pictures are refused: fields are compared in colour. Raises InvalidInputError, which does not name the file.
    """
    if hasattr(message, "encoding"):
        return _raw(message)
    return decode_picture(message.data, "compressed rgb" in message.format, aspect)


def _raw(message: Any) -> UInt8[Tensor, "height width 3"]:
    encoding, height, width, step = message.encoding, int(message.height), int(message.width), int(message.step)
    if encoding in _GREY:
        raise InvalidInputError(f"it is grey ({encoding}), and {GREY}")
    if encoding not in _ORDERS:
        raise InvalidInputError(f"its encoding {encoding!r} is not known here; known are {', '.join(_ORDERS)}")
    stored, channels = np.frombuffer(message.data, np.uint8), 4 if "a" in encoding else 3
    if min(height, width) < 1 or step < width * channels or stored.size < step * height:
        raise InvalidInputError(
            f"it says {width} x {height} pixels of {encoding} in rows of {step} bytes, and has {stored.size} bytes"
        )
    rows = stored[: step * height].reshape(height, step)[:, : width * channels].reshape(height, width, channels)
    return torch.from_numpy(rows[..., list(_ORDERS[encoding])].copy())


def camera_of(message: Any, topic: str) -> Camera | None:
    """The camera that a CameraInfo tells for a topic of pictures; None where it says that it is not calibrated.

    Pictures of a topic named image_rect... are rectified: theirs is the projection P, without distortion. Those of a
    region of interest or with binning have a part of the camera's, as ROS's image_geometry takes it. Raises
    InvalidInputError for a lens of another model.
    """
    if not np.any(message.k):
        return None
    rectified = PurePosixPath(topic.removesuffix("/compressed")).name.startswith(_RECTIFIED)
    given = {name: getattr(message, name) for name in ("width", "height", "distortion_model", "binning_x", "binning_y")}
    given |= {name: list(map(float, getattr(message, name))) for name in ("k", "p", "d")}
    given["roi"] = {name: getattr(message.roi, name) for name in ("x_offset", "y_offset", "width", "height")}
    return parse_camera(given, "CameraInfo", rectified)


_USER = "reading a recording of ROS"
Message = Any
"""A message of ROS, whose type is made of its definition when it is read."""


def messages(path: Path, topic: str) -> Iterator[tuple[float, Message]]:
    """Time [s] and content of each message of a topic."""
    for written_ns, message in read(path, topic):
        stamp = message.header.stamp
        taken_ns = 10**9 * stamp.sec + stamp.nanosec
        yield 1e-9 * (taken_ns or written_ns), message


def read(path: Path, topic: str) -> Iterator[tuple[int, Message]]:
    """When each message of a topic was written [ns], and what it is; none, where there is no such topic."""
    with opened(path) as reader:
        wanted = [connection for connection in reader.connections if connection.topic == topic]
        for connection, written_ns, data in reader.messages(wanted) if wanted else ():
            yield written_ns, _typestore().deserialize_cdr(data, connection.msgtype)


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """A reader of the recording, which turns what it complains about into one sentence."""
    rosbag2 = import_extra("rosbags.rosbag2", "ros", _USER)
    try:
        with rosbag2.Reader(path) as reader:
            for connection in reader.connections:
                _require_topic(connection.topic, connection.msgtype, connection.msgcount)
            yield reader
    except Exception as error:  # its storages raise of four libraries' own kinds where a file is damaged
        why = " ".join(str(error).split()) or type(error).__name__
        raise InvalidInputError(f"{path} is no whole recording of ROS 2, or cut off: {why}") from error


def _require_topic(name: Any, kind: Any, count: Any) -> None:
    """Raise InvalidInputError for a topic of metadata.yaml whose entries, which rosbags takes as they are, have other
    types than theirs."""
    wrong = [reprlib.repr(value) for value in (name, kind) if not isinstance(value, str)]
    wrong += [reprlib.repr(count)] if not isinstance(count, int) else []
    if wrong:
        raise InvalidInputError(
            f"in its metadata.yaml a topic has {wrong[0]} where its name, its type or its number of messages is needed"
        )


@cache
def _typestore() -> Any:
    """Message types of ROS 2."""
    typesys = import_extra("rosbags.typesys", "ros", _USER)
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)


def chosen(path: Path, pictured: list[str], topic: str | None) -> str:
    """The topic to read: the given one, or the only one. Raises InvalidInputError where there is none such."""
    if not pictured:
        raise InvalidInputError(f"{path} has no pictures: nothing in it is a sensor_msgs/Image or CompressedImage")
    listed = ", ".join(sorted(pictured))
    if topic is not None and topic not in pictured:
        raise InvalidInputError(f"{path} has no pictures in {topic}; it has some in {listed}")
    if topic is None and len(pictured) > 1:
        raise InvalidInputError(f"{path} has pictures in several topics: choose one with --topic of {listed}")
    return topic or pictured[0]


def _shared(name: str, topic: str) -> int:
    """Return how many parts of a topic's namespace are those of another topic, from the root."""
    pairs = zip(PurePosixPath(name).parent.parts, PurePosixPath(topic).parts, strict=False)
    return len(list(takewhile(lambda pair: pair[0] == pair[1], pairs)))


def is_above(name: str, topic: str) -> bool:
    """Return True for a topic in the namespace of another one, or in one around that."""
    return _shared(name, topic) == len(PurePosixPath(name).parent.parts)


def nearest(names: list[str], topic: str) -> str | None:
    """The topic whose namespace has most in common with another one, then the first by name."""
    return min(names, key=lambda name: (-_shared(name, topic), name), default=None)


CAMERA_INFO, IMU = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/Imu"
_STATIC = "/tf_static"


@dataclass(frozen=True)
class BagSource:
    """The pictures of one topic of a recording (a FrameSource)."""

    path: Path
    """The file or folder."""
    topic: str
    """Of the pictures."""
    camera: Camera | None
    """What took them, where CameraInfo says so."""
    count: int | None
    """How many pictures there are."""
    imu: str | None
    """Topic of the inertial measurements: the one whose name has most in common with that of the pictures."""

    def frames(self) -> Iterator[Frame]:
        """Each picture. Raises InvalidInputError where one cannot be read, or where time runs backwards."""
        last = None
        for index, (time, message) in enumerate(messages(self.path, self.topic)):
            name = f"frame {index}"
            last = require_later(time, last, f"{name} of {self.topic} in {self.path}")
            yield Frame(time, _picture(self.path, name, message, self.camera), name)

    @property
    def inertial(self) -> ImuMeasurements | None:
        """Inertial measurements, read when it is first asked for, which goes through the whole file.

        Raises InvalidInputError where time runs backwards, and for what is no number.
        """
        return self._measured

    @cached_property
    def _measured(self) -> ImuMeasurements | None:
        if self.imu is None:
            return None
        times, rates, forces, frame = [], [], [], ""
        for time, message in messages(self.path, self.imu):
            frame = message.header.frame_id
            last = times[-1] if times else None
            times.append(require_later(time, last, f"measurement {len(times)} of {self.imu} in {self.path}"))
            rate, force = message.angular_velocity, message.linear_acceleration
            rates.append((rate.x, rate.y, rate.z))
            forces.append((force.x, force.y, force.z))
        if not times:
            return None
        taken = torch.tensor(times, dtype=torch.float64)
        measured = ImuMeasurements(taken, torch.tensor(rates), torch.tensor(forces), self._mount(frame))
        return measured.finite(f"{self.imu} of {self.path}")

    def _mount(self, unit: str) -> Pose | None:
        """T_imu_camera, where /tf_static knows the frames of both, that of the unit and that of the pictures."""
        first = next(messages(self.path, self.topic), None)
        tree = tree_of(message for _, message in read(self.path, _STATIC))
        camera = "" if first is None else first[1].header.frame_id
        known = {*tree, *(parent for parent, _ in tree.values())}
        given = between(tree, unit, camera) if {unit, camera} <= known else None
        return None if given is None else mount_of(given)


def is_bag(path: Path) -> bool:
    """Return True for a recording of ROS 2: a file by its suffix, a folder by what lies in it."""
    return (path / "metadata.yaml").is_file() if path.is_dir() else path.suffix.lower() in (".mcap", ".db3")


def open_bag(path: Path, topic: str | None = None) -> BagSource:
    """The pictures of a recording, of the given topic or of the only one.

    Raises InvalidInputError where there are none, or of several topics, and MissingExtraError without rosbags.
    """
    with opened(path) as reader:
        topics = {connection.topic: connection for connection in reader.connections}
    topic = chosen(path, [name for name, about in topics.items() if about.msgtype in (IMAGE, COMPRESSED)], topic)
    first = next(messages(path, topic), None)
    if first is None:
        raise InvalidInputError(f"{path} has no pictures in {topic}")
    infos = [name for name, about in topics.items() if about.msgtype == CAMERA_INFO and is_above(name, topic)]
    given = nearest(infos, topic)
    camera = None if given is None else _camera(path, given, topic)
    picture = _picture(path, "frame 0", first[1], camera)
    if camera is not None:
        try:
            camera = camera.for_picture(picture.shape[1], picture.shape[0])
        except InvalidInputError as error:
            raise InvalidInputError(f"{given} of {path}: {error}") from error
    imu = nearest([name for name, about in topics.items() if about.msgtype == IMU and about.msgcount], topic)
    return BagSource(path, topic, camera, topics[topic].msgcount, imu)


def _camera(path: Path, given: str, topic: str) -> Camera | None:
    first = next(messages(path, given), None)
    try:
        return None if first is None else camera_of(first[1], topic)
    except InvalidInputError as error:
        raise InvalidInputError(f"{given} of {path} holds no camera that is supported: {error}") from error


def _picture(path: Path, name: str, message: Message, camera: Camera | None) -> torch.Tensor:
    try:
        return decode_image_message(message, None if camera is None else camera.aspect)
    except InvalidInputError as error:
        raise InvalidInputError(f"{name} of {path} cannot be used: {error}") from error
