"""TUM's RGB-D sequences: pictures, depth and poses in lists, which are matched by their times.

    rgb.txt, depth.txt    stamp [s], file; depth is along the optical axis in 1/5000 m, 0 where nothing was measured
    groundtruth.txt       stamp [s], tx ty tz [m], qx qy qz qw: T_world_camera, with OpenCV axes

The sequences do not hold the lens: it is read from a calibration beside the lists, or taken to be the benchmark's own.
Of long sequences, pictures at equal distances are used.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import LARGEST, NamedFiles, parse_number, parse_stamp, read_camera, read_rows
from nerfnav.geometry import so3
from nerfnav.importers.captures.views import CaptureError, DepthFile, Lens, View, Views
from nerfnav.importers.core.placement import OPENGL

_LISTS = ("rgb.txt", "groundtruth.txt")
_CALIBRATIONS = ("calibration", "camera", "sensor", "camera_info")
"""Names of a calibration beside the lists, as .yaml, .yml, .json or .xml."""
_BENCHMARK = Lens.measured("TUM", (640, 480), (525.0, 525.0), (319.5, 239.5))
"""Lens that the benchmark gives for all its cameras."""
_UNIT = 1 / 5000
_APART = 0.02
"""Longest time between a picture and its pose or depth [s], as the benchmark matches them."""
_MOST = 300
"""Pictures that are used: more of the same walk tell little more and take time."""


def find_tum(folder: Path) -> Path | None:
    """The folder itself, where it holds pictures and poses; None otherwise."""
    return folder if all((folder / name).is_file() for name in _LISTS) else None


def read_tum(folder: Path) -> Views:
    """Read a sequence. Raises CaptureError where a list is no list, and where no picture has a pose."""
    try:
        times, names = _read_list(folder / _LISTS[0])
        taken, poses = _read_poses(folder / _LISTS[1])
        depth_times, depth_names = _read_list(folder / "depth.txt") if (folder / "depth.txt").is_file() else ([], [])
        lens, guesses = _lens(folder)
    except InvalidInputError as error:
        raise CaptureError(str(error)) from error
    matched = [(name, pose, _nearest(depth_times, time)) for name, time in zip(names, times, strict=True)
               if (pose := _nearest(taken, time)) is not None]  # fmt: skip
    if not matched:
        raise CaptureError(f"no picture of {folder / _LISTS[0]} was taken within {_APART} s of a pose in {_LISTS[1]}")
    every = -(-len(matched) // _MOST)
    if every > 1:
        guesses = (*guesses, f"pictures: one of {every} is used, of {len(matched)} with poses")
    files = NamedFiles(folder)
    views = tuple(
        View(name, files.find(name), lens, poses[pose],
             depth=None if depth is None else DepthFile(files.find(depth_names[depth]), _UNIT))
        for name, pose, depth in matched[::every]
    )  # fmt: skip
    return Views("TUM RGB-D", views, guesses=guesses)


def _read_list(path: Path) -> tuple[list[float], list[str]]:
    """Stamps [s] and names."""
    rows = read_rows(path, 2, named=True)
    return [parse_stamp(row.cells[0], row.where) for row in rows], [row.cells[1] for row in rows]


def _read_poses(path: Path) -> tuple[list[float], list[np.ndarray]]:
    """Stamps [s], which must grow, and T_world_camera (4, 4) with OpenGL axes."""
    rows = read_rows(path, 8)
    times, poses = [parse_stamp(row.cells[0], row.where) for row in rows], []
    for index, (last, time) in enumerate(pairwise(times), 1):
        if not time > last:
            raise CaptureError(f"{rows[index].where} has the stamp {time:.6f} s after {last:.6f} s: time must go on")
    for row in rows:
        *position, qx, qy, qz, qw = (parse_number(cell, row.where) for cell in row.cells[1:8])
        if max(map(abs, position)) >= LARGEST or not 1e-6 < np.linalg.norm([qx, qy, qz, qw]) < LARGEST:
            raise CaptureError(f"{row.where} holds no pose: its quaternion is zero, or a number is beyond measure")
        pose = np.eye(4)
        quaternion = torch.tensor([qw, qx, qy, qz], dtype=torch.float64)
        pose[:3, :3], pose[:3, 3] = so3.matrix_from_quaternion(quaternion).numpy(), position
        poses.append(pose @ OPENGL)
    return times, poses


def _nearest(times: list[float], time: float) -> int | None:
    """Index of the nearest of times [s] that grow; None where none is near enough."""
    if not times:
        return None
    after = min(int(np.searchsorted(times, time)), len(times) - 1)
    index = min((max(after - 1, 0), after), key=lambda each: abs(times[each] - time))
    return index if abs(times[index] - time) <= _APART else None


def _lens(folder: Path) -> tuple[Lens, tuple[str, ...]]:
    """The lens of the calibration beside the lists, or the benchmark's, with a sentence on that."""
    paths = (folder / f"{name}{suffix}" for name in _CALIBRATIONS for suffix in (".yaml", ".yml", ".json", ".xml"))
    path = next((path for path in paths if path.is_file()), None)
    if path is None:
        words = "lens: a focal length of 525 pixels at 640 x 480, as TUM's benchmark has it (calibration.yaml tells it)"
        return _BENCHMARK, (words,)
    camera = read_camera(path)
    size, focal, center = (camera.width, camera.height), (camera.fx, camera.fy), (camera.cx, camera.cy)
    return Lens.measured(str(path), size, focal, center, *camera.distortion, fisheye=camera.fisheye), ()
