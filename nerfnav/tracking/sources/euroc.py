"""EuRoC datasets: folders in the ASL format.

mav0/cam0/sensor.yaml     resolution, intrinsics, distortion_model, distortion_coefficients, T_BS of the camera
mav0/cam0/data.csv        #timestamp [ns], filename          pictures lie in mav0/cam0/data/
mav0/imu0/data.csv        #timestamp [ns], w_x, w_y, w_z [rad/s], a_x, a_y, a_z [m/s^2]
mav0/imu0/sensor.yaml     T_BS of the unit, of which nothing means that it is the body; gyroscope_noise_density,
                          gyroscope_random_walk, accelerometer_noise_density, accelerometer_random_walk

sensor.yaml tells the lens, the mount and the noise of a sensor.
"""

import itertools
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
import torch
from msgspec import Meta

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import (
    LARGEST,
    NamedFiles,
    Number,
    Positive,
    convert_record,
    flatten_matrix,
    parse_nanoseconds,
    parse_number,
    read_camera,
    read_entries,
    read_rows,
)
from nerfnav.geometry import Pose
from nerfnav.tracking.frame import ImuMeasurements, ImuNoise, mount_of
from nerfnav.tracking.sources.pictures import FileSource, TimedFile, require_later

_WALK = Annotated[float, Meta(ge=0, lt=LARGEST)]
"""Random walk of a bias, which may stand still; no measurement is without noise."""


class Sensor(msgspec.Struct, frozen=True):
    """Entries of a sensor's file beside the lens."""

    T_BS: Annotated[list[Number], Meta(min_length=16, max_length=16)] | None = None
    gyroscope_noise_density: Positive | None = None
    gyroscope_random_walk: _WALK | None = None
    accelerometer_noise_density: Positive | None = None
    accelerometer_random_walk: _WALK | None = None

    @property
    def noise(self) -> ImuNoise:
        """Noise of an inertial measurement unit."""
        return ImuNoise(
            self.gyroscope_noise_density, self.accelerometer_noise_density,
            self.gyroscope_random_walk, self.accelerometer_random_walk,
        )  # fmt: skip


def read_sensor(file: Path) -> Sensor:
    """Read the file of a sensor, which may be missing. Raises InvalidInputError, with the key, where it is unusable."""
    entries = read_entries(file)[0] if file.is_file() else {}
    return convert_record({**entries, "T_BS": flatten_matrix(entries.get("T_BS"))}, Sensor, file, strict=False)


def mount_between(unit: Path, camera: Path) -> Pose | None:
    """T_imu_camera, where the camera's file says how that is mounted."""
    on_body = _on_body(camera / "sensor.yaml")
    if on_body is None:
        return None
    back = _on_body(unit / "sensor.yaml")
    return mount_of(on_body if back is None else np.linalg.inv(back) @ on_body)


def _on_body(file: Path) -> np.ndarray | None:
    """T_BS of a sensor; None where nothing is said of it. Raises InvalidInputError where it is no motion."""
    numbers = read_sensor(file).T_BS
    if numbers is None:
        return None
    matrix = np.array(numbers).reshape(4, 4)
    if not np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-3):
        raise InvalidInputError(f"{file} tells a T_BS that is no turn and shift")
    return matrix


_TABLE = "data.csv"


def is_euroc(path: Path) -> bool:
    """Return True for such a folder, or its mav0."""
    return any(_root(path).glob(f"cam*/{_TABLE}"))


def open_euroc(path: Path, camera: str | None = None) -> FileSource:
    """The pictures of one camera, cam0 unless another is named. Raises InvalidInputError where it cannot be read."""
    root, name = _root(path), camera or "cam0"
    folder = root / name
    if not (folder / _TABLE).is_file():
        known = ", ".join(sorted(table.parent.name for table in root.glob(f"cam*/{_TABLE}")))
        raise InvalidInputError(f"{path} has no pictures in {name}; it has some in {known or 'no folder'}")
    table = read_rows(folder / _TABLE, 2, named=True)
    if not table:
        raise InvalidInputError(f"{folder / _TABLE} lists no pictures")
    files = NamedFiles(folder / "data")
    paths = (files.find(row.cells[1]) for row in table)
    listed = tuple(TimedFile(time, path) for time, path in zip(parse_nanoseconds(table), paths, strict=True))
    sensor = folder / "sensor.yaml"
    lens, inertial = read_camera(sensor) if sensor.is_file() else None, _inertial(root / "imu0", folder)
    aspect = None if lens is None else lens.aspect
    return FileSource(listed, aspect, lens, inertial)


def _root(path: Path) -> Path:
    return path / "mav0" if (path / "mav0").is_dir() else path


def _inertial(folder: Path, camera: Path) -> ImuMeasurements | None:
    if not (folder / _TABLE).is_file():
        return None
    table = read_rows(folder / _TABLE, 7)
    if not table:
        return None
    times = parse_nanoseconds(table)
    for index, (last, time) in enumerate(itertools.pairwise(times), 1):
        require_later(time, last, f"measurement {index} of {folder / _TABLE}")
    rows = np.array([[parse_number(cell, row.where) for cell in row.cells[1:7]] for row in table])
    measured, taken = torch.from_numpy(rows).float(), torch.tensor(times, dtype=torch.float64)
    mount, noise = mount_between(folder, camera), read_sensor(folder / "sensor.yaml").noise
    return ImuMeasurements(taken, measured[:, :3], measured[:, 3:], mount, noise).finite(str(folder / _TABLE))
