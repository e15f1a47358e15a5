"""Folders in the ASL format, that of the EuRoC datasets.

    mav0/cam0/sensor.yaml     resolution, intrinsics, distortion_model, distortion_coefficients, T_BS of the camera
    mav0/cam0/data.csv        #timestamp [ns], filename          pictures lie in mav0/cam0/data/
    mav0/imu0/data.csv        #timestamp [ns], w_x, w_y, w_z [rad/s], a_x, a_y, a_z [m/s^2]
    mav0/imu0/sensor.yaml     T_BS of the unit, of which nothing means that it is the body; gyroscope_noise_density,
                              gyroscope_random_walk, accelerometer_noise_density, accelerometer_random_walk
"""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera
from nerfnav.tracking.frame import Frame, Inertial
from nerfnav.tracking.sources.decoded import decoded
from nerfnav.tracking.sources.euroc_sensors import camera_of, mount_between, noise_of
from nerfnav.tracking.sources.in_order import after

_TABLE = "data.csv"


@dataclass(frozen=True)
class EurocSource:
    """The pictures of one camera of a folder (a FrameSource)."""

    folder: Path
    """Of the camera: mav0/cam0."""
    rows: tuple[tuple[float, str], ...]
    """Time [s] and file of each picture."""
    camera: Camera | None
    """What took them, where sensor.yaml says so."""
    inertial: Inertial | None
    """What mav0/imu0 says, where it is there."""

    @property
    def count(self) -> int:
        """How many pictures there are."""
        return len(self.rows)

    def frames(self) -> Iterator[Frame]:
        """Each picture. Raises InvalidInputError where one cannot be read, or where time runs backwards."""
        last = None
        for time, name in self.rows:
            last, file = after(time, last, f"{name} of {self.folder}"), self.folder / "data" / name
            try:
                picture = decoded(file.read_bytes(), aspect=None if self.camera is None else self.camera.aspect)
            except FileNotFoundError as error:
                raise InvalidInputError(f"{self.folder / _TABLE} lists {name}, which is not there") from error
            except InvalidInputError as error:
                raise InvalidInputError(f"{file} cannot be used: {error}") from error
            yield Frame(time, picture, name)


def is_euroc(path: Path) -> bool:
    """Whether a folder is one of these, or its mav0."""
    return any(_root(path).glob(f"cam*/{_TABLE}"))


def open_euroc(path: Path, camera: str | None = None) -> EurocSource:
    """The pictures of one camera, cam0 unless another is named. Raises InvalidInputError where it cannot be read."""
    root, name = _root(path), camera or "cam0"
    folder = root / name
    if not (folder / _TABLE).is_file():
        known = ", ".join(sorted(table.parent.name for table in root.glob(f"cam*/{_TABLE}")))
        raise InvalidInputError(f"{path} has no pictures in {name}; it has some in {known or 'no folder'}")
    rows = tuple((1e-9 * _number(folder, row[0]), row[1].strip()) for row in _table(folder, 2))
    if not rows:
        raise InvalidInputError(f"{folder / _TABLE} lists no pictures")
    return EurocSource(folder, rows, camera_of(folder / "sensor.yaml"), _inertial(root / "imu0", folder))


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


def _inertial(folder: Path, camera: Path) -> Inertial | None:
    if not (folder / _TABLE).is_file():
        return None
    rows = np.array([[_number(folder, cell) for cell in row[:7]] for row in _table(folder, 7)], dtype=np.float64)
    if not len(rows):
        return None
    times = 1e-9 * rows[:, 0]
    for index in np.flatnonzero(~(np.diff(times) > 0)):
        after(float(times[index + 1]), float(times[index]), f"measurement {index + 1} of {folder / _TABLE}")
    measured = torch.from_numpy(rows[:, 1:]).float()
    mount, noise = mount_between(folder, camera), noise_of(folder / "sensor.yaml")
    told = Inertial(torch.from_numpy(times), measured[:, :3], measured[:, 3:], mount, noise)
    return told.finite(str(folder / _TABLE))
