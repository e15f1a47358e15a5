"""EuRoC datasets: folders in the ASL format.

mav0/cam0/sensor.yaml     resolution, intrinsics, distortion_model, distortion_coefficients, T_BS of the camera
mav0/cam0/data.csv        #timestamp [ns], filename          pictures lie in mav0/cam0/data/
mav0/imu0/data.csv        #timestamp [ns], w_x, w_y, w_z [rad/s], a_x, a_y, a_z [m/s^2]
mav0/imu0/sensor.yaml     T_BS of the unit, of which nothing means that it is the body; gyroscope_noise_density,
                          gyroscope_random_walk, accelerometer_noise_density, accelerometer_random_walk

sensor.yaml tells the lens, the mount and the noise of a sensor.
"""

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera, Pose, parse_camera
from nerfnav.tracking.frame import Frame, ImuMeasurements, ImuNoise, mount_of
from nerfnav.tracking.sources.pictures import FileSource, TimedFile, decode_picture, require_later

_MODELS = {"radial-tangential": "plumb_bob", "equidistant": "equidistant"}
"""Lens models to the words of ROS."""
_HEADING = "%YAML:1.0"
"""OpenCV's first line, which is no YAML."""
_NOISE = {
    "gyro": "gyroscope_noise_density", "accel": "accelerometer_noise_density",
    "gyro_walk": "gyroscope_random_walk", "accel_walk": "accelerometer_random_walk",
}  # fmt: skip
"""What a unit's file calls its noise."""


def camera_of(file: Path) -> Camera | None:
    """The camera that a file tells; None where there is none. Raises InvalidInputError where it is no calibration."""
    if not file.is_file():
        return None
    try:
        given = _parsed(file)
        fx, fy, cx, cy = map(float, given["intrinsics"])
        model = str(given.get("distortion_model", ""))
        width, height = given["resolution"]
        return parse_camera({
            "image_width": width, "image_height": height, "camera_matrix": [fx, 0, cx, 0, fy, cy, 0, 0, 1],
            "distortion_model": _MODELS.get(model, model),
            "distortion_coefficients": given.get("distortion_coefficients"),
        })  # fmt: skip
    except (OSError, KeyError, TypeError, ValueError, AttributeError, yaml.YAMLError, InvalidInputError) as error:
        raise InvalidInputError(f"{file} is no calibration of a camera: {' '.join(str(error).split())}") from error


def mount_between(unit: Path, camera: Path) -> Pose | None:
    """T_imu_camera, where the camera's file says how that is mounted."""
    on_body = _on_body(camera / "sensor.yaml")
    if on_body is None:
        return None
    back = _on_body(unit / "sensor.yaml")
    return mount_of(on_body if back is None else np.linalg.inv(back) @ on_body)


def _on_body(file: Path) -> np.ndarray | None:
    """T_BS of a sensor; None where nothing is said of it. Raises InvalidInputError where it is no motion."""
    given = _read_sensor(file) if file.is_file() else {}
    if "T_BS" not in given:
        return None
    try:
        matrix = np.array(given["T_BS"]["data"], dtype=np.float64).reshape(4, 4)
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidInputError(f"{file} tells no T_BS of 16 numbers") from error
    if not (np.isfinite(matrix).all() and np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-3)):
        raise InvalidInputError(f"{file} tells a T_BS that is no turn and shift")
    return matrix


def noise_of(file: Path) -> ImuNoise:
    """Read the noise in a unit's file. Raises InvalidInputError where that cannot be."""
    given = _read_sensor(file) if file.is_file() else {}
    return ImuNoise(**{
        ours: _density(file, theirs, given[theirs]) for ours, theirs in _NOISE.items() if theirs in given
    })  # fmt: skip


def _density(file: Path, name: str, value: object) -> float:
    """A spectral density. A bias may stand still, but no measurement is without noise."""
    try:
        density = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        density = math.nan
    still = name.endswith("_random_walk")
    if not (0 < density < math.inf or (still and density == 0)):
        least = "at least 0" if still else "more than 0"
        raise InvalidInputError(f"{name} in {file} is a finite number of {least}, not {value!r}")
    return density


def _parsed(file: Path) -> Any:
    """The YAML of a sensor's file, whose heading parsers do not know."""
    return yaml.safe_load(file.read_text().removeprefix(_HEADING))


def _read_sensor(file: Path) -> dict[str, Any]:
    """Read a sensor's file. Raises InvalidInputError where it cannot be read."""
    try:
        given = _parsed(file)
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InvalidInputError(f"{file} cannot be read: {' '.join(str(error).split())}") from error
    return given if isinstance(given, dict) else {}


_TABLE = "data.csv"


@dataclass(frozen=True, kw_only=True)
class EurocSource(FileSource):
    """The pictures of one camera of a folder: files in its folder `data`, by their names there."""

    folder: Path
    """Of the camera: mav0/cam0."""

    def frames(self) -> Iterator[Frame]:
        """Each picture. Raises InvalidInputError where one cannot be read, or where time runs backwards."""
        last = None
        for time, file in self.listed:
            name = str(file)
            last, file = require_later(time, last, f"{name} of {self.folder}"), self.folder / "data" / name
            try:
                picture = decode_picture(file.read_bytes(), aspect=self.aspect)
            except FileNotFoundError as error:
                raise InvalidInputError(f"{self.folder / _TABLE} lists {name}, which is not there") from error
            except InvalidInputError as error:
                raise InvalidInputError(f"{file} cannot be used: {error}") from error
            yield Frame(time, picture, name)


def is_euroc(path: Path) -> bool:
    """Return True for such a folder, or its mav0."""
    return any(_root(path).glob(f"cam*/{_TABLE}"))


def open_euroc(path: Path, camera: str | None = None) -> EurocSource:
    """The pictures of one camera, cam0 unless another is named. Raises InvalidInputError where it cannot be read."""
    root, name = _root(path), camera or "cam0"
    folder = root / name
    if not (folder / _TABLE).is_file():
        known = ", ".join(sorted(table.parent.name for table in root.glob(f"cam*/{_TABLE}")))
        raise InvalidInputError(f"{path} has no pictures in {name}; it has some in {known or 'no folder'}")
    rows = tuple(TimedFile(1e-9 * _number(folder, row[0]), Path(row[1].strip())) for row in _table(folder, 2))
    if not rows:
        raise InvalidInputError(f"{folder / _TABLE} lists no pictures")
    lens, inertial = camera_of(folder / "sensor.yaml"), _inertial(root / "imu0", folder)
    aspect = None if lens is None else lens.aspect
    return EurocSource(listed=rows, aspect=aspect, camera=lens, inertial=inertial, folder=folder)


def _root(path: Path) -> Path:
    return path / "mav0" if (path / "mav0").is_dir() else path


def _table(folder: Path, columns: int) -> Iterator[list[str]]:
    """Rows of the table of a sensor, without comments."""
    try:
        with (folder / _TABLE).open(newline="", encoding="utf-8") as stream:
            for number, row in enumerate(csv.reader(stream), 1):
                if not row or row[0].startswith("#"):
                    continue
                if len(row) < columns:
                    raise InvalidInputError(
                        f"line {number} of {folder / _TABLE} has {len(row)} columns, where {columns} are needed"
                    )
                yield row
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InvalidInputError(f"{folder / _TABLE} cannot be read: {error}") from error


def _number(folder: Path, cell: str) -> float:
    try:
        return float(cell)
    except ValueError as error:
        raise InvalidInputError(f"{folder / _TABLE} has {cell!r} where a number should be") from error


def _inertial(folder: Path, camera: Path) -> ImuMeasurements | None:
    if not (folder / _TABLE).is_file():
        return None
    rows = np.array([[_number(folder, cell) for cell in row[:7]] for row in _table(folder, 7)], dtype=np.float64)
    if not len(rows):
        return None
    times = 1e-9 * rows[:, 0]
    for index in np.flatnonzero(~(np.diff(times) > 0)):
        require_later(float(times[index + 1]), float(times[index]), f"measurement {index + 1} of {folder / _TABLE}")
    measured = torch.from_numpy(rows[:, 1:]).float()
    mount, noise = mount_between(folder, camera), noise_of(folder / "sensor.yaml")
    given = ImuMeasurements(torch.from_numpy(times), measured[:, :3], measured[:, 3:], mount, noise)
    return given.finite(str(folder / _TABLE))
