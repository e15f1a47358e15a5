"""Recordings for tests, written by others' programs: mcap-ros2-support and rosbags."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap_ros2.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
Write = Callable[[str, str, float, dict[str, Any]], None]
"""Writes a message: topic, type, time [s], fields."""
MATRIX, LENS = (30.0, 0.0, 16.0, 0.0, 31.0, 12.0, 0.0, 0.0, 1.0), (-0.2, 0.05, 0.001, -0.002, 0.0)


def picture(index: int = 0) -> np.ndarray:
    """RGB, 24 x 32, another one for each index."""
    return np.random.default_rng(index).integers(0, 256, (24, 32, 3), np.uint8)


def header(time: float, frame: str = "camera") -> dict[str, Any]:
    return {"stamp": {"sec": int(time), "nanosec": round(1e9 * (time - int(time)))}, "frame_id": frame}


def image(time: float, pixels: np.ndarray, encoding: str = "rgb8", padding: int = 0) -> dict[str, Any]:
    """An Image whose rows end with some bytes of padding."""
    rows = pixels.reshape(pixels.shape[0], -1).view(np.uint8)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    return {
        "header": header(time), "height": pixels.shape[0], "width": pixels.shape[1], "encoding": encoding,
        "is_bigendian": 0, "step": rows.shape[1], "data": rows.ravel(),
    }  # fmt: skip


def compressed(time: float, pixels: np.ndarray, kind: str = "png") -> dict[str, Any]:
    pixels = pixels if pixels.ndim == 2 else pixels[..., ::-1]
    _, stored = cv2.imencode(f".{kind}", pixels)
    return {"header": header(time), "format": kind, "data": stored.ravel()}


def camera_info(**changed: Any) -> dict[str, Any]:
    info = {
        "header": header(0), "height": 24, "width": 32, "distortion_model": "plumb_bob", "d": LENS, "k": MATRIX,
        "r": np.eye(3).ravel(), "p": (28.0, 0, 15, 0, 0, 28.5, 11, 0, 0, 0, 1, 0), "binning_x": 0, "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }  # fmt: skip
    return info | changed


def imu(time: float, rate: Iterable[float], force: Iterable[float]) -> dict[str, Any]:
    rate, force = (dict(zip("xyz", map(float, part), strict=True)) for part in (rate, force))
    return {
        "header": header(time, "imu"), "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        "orientation_covariance": np.zeros(9), "angular_velocity": rate, "angular_velocity_covariance": np.zeros(9),
        "linear_acceleration": force, "linear_acceleration_covariance": np.zeros(9),
    }  # fmt: skip


def static_frames(*told: tuple[str, str, tuple[float, ...], tuple[float, ...]]) -> dict[str, Any]:
    """A TFMessage: of each frame its parent, name, place and quaternion (x, y, z, w)."""
    transforms = []
    for parent, child, place, turn in told:
        moved = {"translation": dict(zip("xyz", place, strict=True)), "rotation": dict(zip("xyzw", turn, strict=True))}
        transforms.append({"header": header(0, parent), "child_frame_id": child, "transform": moved})
    return {"transforms": transforms}


@contextmanager
def mcap_file(path: Path) -> Iterator[Write]:
    """An MCAP by mcap-ros2-support."""
    schemas: dict[str, Any] = {}
    with path.open("wb") as stream:
        writer = McapWriter(stream)

        def write(topic: str, kind: str, time: float, fields: dict[str, Any]) -> None:
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(kind, STORE.generate_msgdef(kind, ros_version=2)[0])
            plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in fields.items()}
            if "data" in fields:
                plain["data"] = bytes(fields["data"])
            writer.write_message(topic, schemas[kind], plain, round(1e9 * time), round(1e9 * time))

        yield write
        writer.finish()


@contextmanager
def bag_folder(path: Path, storage: StoragePlugin = StoragePlugin.SQLITE3) -> Iterator[Write]:
    """A rosbag2 by rosbags."""
    with BagWriter(path, version=9, storage_plugin=storage) as writer:
        connections: dict[str, Any] = {}

        def write(topic: str, kind: str, time: float, fields: dict[str, Any]) -> None:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], round(1e9 * time), STORE.serialize_cdr(_message(kind, fields), kind))

        yield write


def _message(kind: str, fields: dict[str, Any]) -> Any:
    """The message of that type with these fields, its parts included."""
    parts = {
        "header": "std_msgs/msg/Header", "stamp": "builtin_interfaces/msg/Time",
        "orientation": "geometry_msgs/msg/Quaternion", "angular_velocity": "geometry_msgs/msg/Vector3",
        "linear_acceleration": "geometry_msgs/msg/Vector3", "roi": "sensor_msgs/msg/RegionOfInterest",
    }  # fmt: skip
    made = {}
    for name, value in fields.items():
        if isinstance(value, dict):
            value = _message(parts[name], value)
        elif isinstance(value, tuple | np.ndarray):
            value = np.asarray(value, np.uint8 if name == "data" else np.float64)
        made[name] = value
    return STORE.types[kind](**made)


@dataclass
class Recorded:
    """What a recording for tests is made of."""

    pictures: int = 3
    topic: str = "/cam/image_raw"
    info: dict[str, Any] | None = field(default_factory=camera_info)
    inertial: bool = True

    def write(self, write: Write) -> None:
        """Pictures 0.1 s apart from 10 s on, measurements 0.01 s apart."""
        if self.info is not None:
            write("/cam/camera_info", "sensor_msgs/msg/CameraInfo", 10.0, self.info)
        for index in range(self.pictures):
            time = 10 + 0.1 * index
            write(self.topic, "sensor_msgs/msg/Image", time, image(time, picture(index)))
            for step in range(10 if self.inertial else 0):
                measured = imu(time + 0.01 * step, (0.1, 0.2, 0.3), (index, step, 9.81))
                write("/imu", "sensor_msgs/msg/Imu", time + 0.01 * step, measured)
