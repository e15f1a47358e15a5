"""Recordings of ROS 2: MCAP files, and rosbag2 in SQLite or MCAP.

Read are sensor_msgs/Image or CompressedImage, CameraInfo of the same namespace and Imu, and in /tf_static how the
camera is mounted on the inertial measurement unit. A message's time is that of its header, or, where its header has
none, that of the recording.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import takewhile
from pathlib import Path, PurePosixPath
from typing import Any

import torch

from nerfnav.errors import InvalidInputError
from nerfnav.extras import from_extra
from nerfnav.geometry import Camera, Pose
from nerfnav.tracking.frame import Frame, Inertial, mount_of
from nerfnav.tracking.sources.in_order import after
from nerfnav.tracking.sources.ros_pictures import COMPRESSED, IMAGE, camera_of, picture_of
from nerfnav.tracking.sources.static_frames import between, tree_of

CAMERA_INFO, IMU = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/Imu"
_STATIC = "/tf_static"
_USER = "reading a recording of ROS"


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
        for index, (time, message) in enumerate(_messages(self.path, self.topic)):
            name = f"frame {index}"
            last = after(time, last, f"{name} of {self.topic} in {self.path}")
            yield Frame(time, _picture(self.path, name, message, self.camera), name)

    @property
    def inertial(self) -> Inertial | None:
        """What an inertial measurement unit said; read when it is first asked for, which goes through the whole file.

        Raises InvalidInputError where time runs backwards, and for what is no number.
        """
        return self._measured

    @cached_property
    def _measured(self) -> Inertial | None:
        if self.imu is None:
            return None
        times, rates, forces, frame = [], [], [], ""
        for time, message in _messages(self.path, self.imu):
            frame = message.header.frame_id
            last = times[-1] if times else None
            times.append(after(time, last, f"measurement {len(times)} of {self.imu} in {self.path}"))
            rate, force = message.angular_velocity, message.linear_acceleration
            rates.append((rate.x, rate.y, rate.z))
            forces.append((force.x, force.y, force.z))
        if not times:
            return None
        taken = torch.tensor(times, dtype=torch.float64)
        measured = Inertial(taken, torch.tensor(rates), torch.tensor(forces), self._mount(frame))
        return measured.finite(f"{self.imu} of {self.path}")

    def _mount(self, unit: str) -> Pose | None:
        """T_imu_camera, where /tf_static knows the frames of both, that of the unit and that of the pictures."""
        first = next(_messages(self.path, self.topic), None)
        tree = tree_of(message for _, message in _read(self.path, _STATIC))
        camera = "" if first is None else first[1].header.frame_id
        known = {*tree, *(parent for parent, _ in tree.values())}
        told = between(tree, unit, camera) if {unit, camera} <= known else None
        return None if told is None else mount_of(told)


def is_bag(path: Path) -> bool:
    """Whether a path is a recording of ROS 2: a file by its suffix, a folder by what lies in it."""
    return (path / "metadata.yaml").is_file() if path.is_dir() else path.suffix.lower() in (".mcap", ".db3")


def open_bag(path: Path, topic: str | None = None) -> BagSource:
    """The pictures of a recording, of the given topic or of the only one.

    Raises InvalidInputError where there are none, or of several topics, and MissingExtraError without rosbags.
    """
    with _opened(path) as reader:
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    topic = _chosen(path, [name for name, kind in kinds.items() if kind in (IMAGE, COMPRESSED)], topic)
    first = next(_messages(path, topic), None)
    if first is None:
        raise InvalidInputError(f"{path} has no pictures in {topic}")
    told = _nearest([name for name, kind in kinds.items() if kind == CAMERA_INFO and _is_above(name, topic)], topic)
    camera = None if told is None else _camera(path, told, topic)
    picture = _picture(path, "frame 0", first[1], camera)
    if camera is not None:
        camera = camera.for_picture(picture.shape[1], picture.shape[0])
    imu = _nearest([name for name, kind in kinds.items() if kind == IMU and counts[name]], topic)
    return BagSource(path, topic, camera, counts[topic], imu)


def _chosen(path: Path, pictured: list[str], topic: str | None) -> str:
    """The topic to read."""
    if not pictured:
        raise InvalidInputError(f"{path} has no pictures: nothing in it is a sensor_msgs/Image or CompressedImage")
    listed = ", ".join(sorted(pictured))
    if topic is not None and topic not in pictured:
        raise InvalidInputError(f"{path} has no pictures in {topic}; it has some in {listed}")
    if topic is None and len(pictured) > 1:
        raise InvalidInputError(f"{path} has pictures in several topics: choose one with --topic of {listed}")
    return topic or pictured[0]


def _shared(name: str, topic: str) -> int:
    """How many parts of a topic's namespace are those of another topic, from the root."""
    pairs = zip(PurePosixPath(name).parent.parts, PurePosixPath(topic).parts, strict=False)
    return len(list(takewhile(lambda pair: pair[0] == pair[1], pairs)))


def _is_above(name: str, topic: str) -> bool:
    """Whether a topic is in the namespace of another one, or in one around that."""
    return _shared(name, topic) == len(PurePosixPath(name).parent.parts)


def _nearest(names: list[str], topic: str) -> str | None:
    """The topic whose namespace has most in common with another one, then the first by name."""
    return min(names, key=lambda name: (-_shared(name, topic), name), default=None)


def _camera(path: Path, told: str, topic: str) -> Camera | None:
    first = next(_messages(path, told), None)
    try:
        return None if first is None else camera_of(first[1], topic)
    except InvalidInputError as error:
        raise InvalidInputError(f"{told} of {path} tells no camera that is known here: {error}") from error


def _picture(path: Path, name: str, message: Any, camera: Camera | None) -> Any:
    try:
        return picture_of(message, None if camera is None else camera.aspect)
    except InvalidInputError as error:
        raise InvalidInputError(f"{name} of {path} cannot be used: {error}") from error


def _messages(path: Path, topic: str) -> Iterator[tuple[float, Any]]:
    """Time [s] and content of each message of a topic."""
    for written_ns, message in _read(path, topic):
        stamp = message.header.stamp
        taken_ns = 10**9 * stamp.sec + stamp.nanosec
        yield 1e-9 * (taken_ns or written_ns), message


def _read(path: Path, topic: str) -> Iterator[tuple[int, Any]]:
    """When each message of a topic was written [ns], and what it is; none, where there is no such topic."""
    with _opened(path) as reader:
        wanted = [connection for connection in reader.connections if connection.topic == topic]
        for connection, written_ns, data in reader.messages(wanted) if wanted else ():
            yield written_ns, _typestore().deserialize_cdr(data, connection.msgtype)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A reader of the recording, which turns what it complains about into one sentence."""
    rosbag2 = from_extra("rosbags.rosbag2", "ros", _USER)
    try:
        with rosbag2.Reader(path) as reader:
            yield reader
    except Exception as error:  # its storages raise of four libraries' own kinds where a file is damaged
        why = " ".join(str(error).split()) or type(error).__name__
        raise InvalidInputError(f"{path} is no whole recording of ROS 2, or cut off: {why}") from error


@cache
def _typestore() -> Any:
    """Message types of ROS 2."""
    typesys = from_extra("rosbags.typesys", "ros", _USER)
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
