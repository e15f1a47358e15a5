"""Depth in exports of phone apps: along rays and in metres, without what the sensor is unsure of or cannot reach."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import lzfse
import numpy as np
import OpenEXR
import pytest
import torch

from nerfnav.core.errors import MissingExtraError
from nerfnav.core.steps import run_steps
from nerfnav.importers.captures.config import ImportConfig, ImportedCapture
from nerfnav.importers.captures.importer import import_capture
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.core.placement import Placement
from tests.importers.captures.phones import write_polycam, write_record3d, write_scanner
from tests.importers.captures.synthetic import CAMERA, RADIUS, depth_ahead, matrices, ring

WIDTH, HEIGHT = 24, 18
REACH = 5.0
"""What a LiDAR reaches [m]."""
LEVELS = np.tile(np.repeat(np.array([0, 1, 2], np.uint8), WIDTH // 3), (HEIGHT, 1))
"""ARKit's confidence: a third of each picture has low, one medium, one high."""


def shown() -> list[np.ndarray]:
    """Depths [m] of the sphere around the cameras, far too large where confidence is low."""
    small = CAMERA.resized(WIDTH, HEIGHT)
    return [np.where(LEVELS == 0, 1.7, 1.0) * depth_ahead(small, pose) for pose in matrices(ring())]


def write_map(path: Path, numbers: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".exr":
        head = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(head, {"Z": numbers.astype(np.float32)}).write(str(path))
    elif path.suffix in (".depth", ".conf"):
        path.write_bytes(lzfse.compress(numbers.astype(np.float32 if path.suffix == ".depth" else np.uint8).tobytes()))
    elif numbers.dtype == np.uint8:
        cv2.imwrite(str(path), numbers)
    else:
        cv2.imwrite(str(path), (1000 * numbers).round().astype(np.uint16))


def polycam(folder: Path) -> None:
    write_polycam(folder)
    for index, depth in enumerate(shown()):
        write_map(folder / "keyframes" / "depth" / f"{55_000_000 + 1000 * index}.png", depth)
        sure = np.array([0, 127, 255], np.uint8)[LEVELS]
        write_map(folder / "keyframes" / "confidence" / f"{55_000_000 + 1000 * index}.png", sure)


def scanner(folder: Path) -> None:
    write_scanner(folder)
    for index, depth in enumerate(shown()):
        write_map(folder / f"depth_{2 * index:05d}.png", depth)
        write_map(folder / f"conf_{2 * index:05d}.png", LEVELS)


def scanner_exr(folder: Path) -> None:
    write_scanner(folder)
    for index, depth in enumerate(shown()):
        write_map(folder / f"frame_{2 * index:05d}.exr", depth)
        write_map(folder / f"conf_{2 * index:05d}.png", LEVELS)


def record3d(folder: Path) -> None:
    write_record3d(folder, dw=WIDTH, dh=HEIGHT)
    for index, depth in enumerate(shown()):
        write_map(folder / "rgbd" / f"{index}.depth", depth)
        write_map(folder / "rgbd" / f"{index}.conf", LEVELS)


EXPORTS = {"Polycam": polycam, "3D Scanner App": scanner, "with OpenEXR": scanner_exr, "Record3D": record3d}
UPRIGHT = ImportConfig(Placement(up=(0.0, 1.0, 0.0)))


def imported(folder: Path, config: ImportConfig = UPRIGHT) -> ImportedCapture:
    return run_steps(import_capture(folder, config))


@pytest.mark.parametrize("name", EXPORTS)
def test_sure_depths_lie_on_what_was_seen_and_others_are_not_measured(name: str, tmp_path: Path) -> None:
    EXPORTS[name](tmp_path)
    found = imported(tmp_path)
    assert found.report.images_with_depth == 8
    taken = found.learned
    assert taken.depth is not None and taken.depth.shape[1:] == (HEIGHT, WIDTH)
    for pose, depth in zip(taken.poses.position, taken.depth, strict=True):
        (index,) = (k for k, there in enumerate(ring().position) if torch.allclose(there, pose, atol=1e-4))
        kept = (LEVELS > 0) & (shown()[index] <= REACH)
        np.testing.assert_array_equal(depth.numpy() > 0, kept)
        assert kept.any() and not kept.all()
    origins, directions = taken.depth_camera.rays(taken.poses[0])
    along = taken.depth[0].reshape(-1, 1)
    points = (origins + along * directions)[along[:, 0] > 0]
    torch.testing.assert_close(points.norm(dim=-1), torch.full((len(points),), RADIUS), atol=2e-3, rtol=0)


def test_an_export_without_confidence_is_trusted_as_far_as_the_sensor_reaches(tmp_path: Path) -> None:
    write_record3d(tmp_path, exported=True)
    for index, depth in enumerate(shown()):
        write_map(tmp_path / "depth" / f"{index}.exr", np.where(LEVELS == 0, 6.0, depth))
    taken = imported(tmp_path).learned
    assert taken.depth is not None
    assert (taken.depth[:, torch.from_numpy(LEVELS == 0)] == 0).all()
    assert (taken.depth[:, torch.from_numpy(LEVELS == 2)] > 0).float().mean() > 0.5


def test_unwanted_depth_needs_no_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record3d(tmp_path)
    monkeypatch.setitem(sys.modules, "lzfse", None)
    assert imported(tmp_path, ImportConfig(UPRIGHT.placement, depth=False)).learned.depth is None
    with pytest.raises(MissingExtraError, match=r"--depth off .* needs lzfse, .* pip install 'nerfnav\[depth\]'"):
        imported(tmp_path)


def _in_metres(folder: Path) -> None:
    for path in folder.glob("depth_*.png"):
        cv2.imwrite(str(path), np.full((HEIGHT, WIDTH), 3, np.uint16))


def _tall(folder: Path) -> None:
    for part, numbers in (("depth", np.ones((24, 18))), ("confidence", np.full((24, 18), 255, np.uint8))):
        write_map(folder / "keyframes" / part / "55000000.png", numbers)


def _nan(folder: Path) -> None:
    write_map(folder / "rgbd" / "3.depth", np.full((HEIGHT, WIDTH), np.nan))


def _no_size(folder: Path) -> None:
    path = folder / "metadata"
    path.write_text(json.dumps({key: value for key, value in json.loads(path.read_text()).items() if key != "dw"}))


def _cut_off(folder: Path) -> None:
    path = folder / "rgbd" / "3.depth"
    path.write_bytes(path.read_bytes()[:90])


@pytest.mark.parametrize(
    ("write", "damage", "reported"),
    [
        (scanner, lambda at: write_map(at / "depth_00000.png", np.ones((24, 18))), "one channel of 18 x 24 is needed"),
        (polycam, _tall, "has another shape than its picture"),
        (polycam, lambda at: write_map(at / "keyframes/confidence/55000000.png", LEVELS[:9]), "has 24 x 9 pixels: one"),
        (scanner, lambda at: (at / "conf_00000.png").write_bytes(b"nothing"), "cannot be read: one channel of 24 x 18"),
        (scanner, _in_metres, "they are in another unit"),
        (scanner_exr, lambda at: (at / "frame_00002.exr").write_bytes(b"v/1"), "is no readable depth map"),
        (record3d, _nan, "depths that are NaN"),
        (record3d, _no_size, "metadata lack dw and dh"),
        (record3d, _cut_off, "is no readable depth map"),
        (record3d, lambda at: write_map(at / "rgbd/3.depth", np.ones((9, 9))), "holds 81 numbers, not the 24 x 18"),
    ],
)
def test_depth_that_cannot_be_used_is_one_sentence(
    write: Callable[[Path], None], damage: Callable[[Path], None], reported: str, tmp_path: Path
) -> None:
    write(tmp_path)
    damage(tmp_path)
    with pytest.raises(CaptureError, match=reported) as caught:
        imported(tmp_path)
    assert "\n" not in str(caught.value)
