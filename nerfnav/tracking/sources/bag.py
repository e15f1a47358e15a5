"""Recordings of ROS 2: MCAP files, and rosbag2 in SQLite or MCAP.

Read are sensor_msgs/Image or CompressedImage, CameraInfo of the same namespace and Imu, and in /tf_static how the
camera is mounted on the inertial measurement unit. A message's time is that of its header, or, where its header has
none, that of the recording.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import torch

from nerfnav.errors import InvalidInputError
from nerfnav.geometry import Camera, Pose
from nerfnav.tracking.frame import Frame, Inertial, mount_of
from nerfnav.tracking.sources.bag_messages import Message, chosen, is_above, messages, nearest, opened, read
from nerfnav.tracking.sources.in_order import after
from nerfnav.tracking.sources.ros_pictures import COMPRESSED, IMAGE, camera_of, picture_of
from nerfnav.tracking.sources.static_frames import between, tree_of

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
        for time, message in messages(self.path, self.imu):
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
        first = next(messages(self.path, self.topic), None)
        tree = tree_of(message for _, message in read(self.path, _STATIC))
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
    with opened(path) as reader:
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    topic = chosen(path, [name for name, kind in kinds.items() if kind in (IMAGE, COMPRESSED)], topic)
    first = next(messages(path, topic), None)
    if first is None:
        raise InvalidInputError(f"{path} has no pictures in {topic}")
    told = nearest([name for name, kind in kinds.items() if kind == CAMERA_INFO and is_above(name, topic)], topic)
    camera = None if told is None else _camera(path, told, topic)
    picture = _picture(path, "frame 0", first[1], camera)
    if camera is not None:
        camera = camera.for_picture(picture.shape[1], picture.shape[0])
    imu = nearest([name for name, kind in kinds.items() if kind == IMU and counts[name]], topic)
    return BagSource(path, topic, camera, counts[topic], imu)


def _camera(path: Path, told: str, topic: str) -> Camera | None:
    first = next(messages(path, told), None)
    try:
        return None if first is None else camera_of(first[1], topic)
    except InvalidInputError as error:
        raise InvalidInputError(f"{told} of {path} tells no camera that is known here: {error}") from error


def _picture(path: Path, name: str, message: Message, camera: Camera | None) -> torch.Tensor:
    try:
        return picture_of(message, None if camera is None else camera.aspect)
    except InvalidInputError as error:
        raise InvalidInputError(f"{name} of {path} cannot be used: {error}") from error
