"""Exports of Polycam, Record3D and 3D Scanner App: the poses and lenses that were written are those that are read."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from nerfnav.core.steps import run_steps
from nerfnav.importers.captures.archive import unpack_capture
from nerfnav.importers.captures.config import ImportConfig
from nerfnav.importers.captures.formats import is_capture, read_views
from nerfnav.importers.captures.importer import import_capture
from nerfnav.importers.captures.views import CaptureError
from tests.importers.captures.phones import (
    arkit_poses,
    write_polycam,
    write_r3d,
    write_record3d,
    write_scanner,
)
from tests.importers.captures.synthetic import CAMERA, matrices, ring

EXPORTS: dict[str, tuple[Callable[[Path], Path], str]] = {
    "Polycam": (write_polycam, "Polycam"),
    "Polycam corrected": (partial(write_polycam, corrected=True), "Polycam"),
    "3D Scanner App": (write_scanner, "3D Scanner App"),
    "Record3D": (write_record3d, "Record3D"),
    "Record3D export": (partial(write_record3d, exported=True), "Record3D"),
    "Record3D own lenses": (partial(write_record3d, own_lenses=True), "Record3D"),
}


@pytest.mark.parametrize("name", EXPORTS)
def test_poses_and_lenses_are_read_as_they_were_written(name: str, tmp_path: Path) -> None:
    write, kind = EXPORTS[name]
    folder = tmp_path / "scan"
    folder.mkdir()
    write(folder)
    assert is_capture(folder)
    found = read_views(folder)
    assert found.kind == kind and len(found.views) == 8
    assert all(view.exists for view in found.views)
    np.testing.assert_allclose([view.pose for view in found.views], arkit_poses(), atol=1e-6)
    for view in found.views:
        camera = view.lens.camera(CAMERA.width, CAMERA.height)
        np.testing.assert_allclose(
            [camera.fx, camera.fy, camera.cx, camera.cy], [CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy], rtol=1e-6
        )


@pytest.mark.parametrize("name", EXPORTS)
def test_exports_are_imported_upright(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "scan"
    folder.mkdir()
    EXPORTS[name][0](folder)
    capture = run_steps(import_capture(folder, ImportConfig()))
    assert capture.report.up == (0, 1, 0) and capture.report.images_used == 8
    poses = np.concatenate([capture.learned.poses.position.numpy(), capture.held_out.poses.position.numpy()])
    heights = np.sort(matrices(ring())[:, 2, 3])
    np.testing.assert_allclose(np.sort(poses[:, 2]), heights, atol=1e-5)


def test_a_recording_of_one_file_is_unpacked_and_read(tmp_path: Path) -> None:
    folder = unpack_capture(write_r3d(tmp_path / "walk.r3d"), tmp_path / "into")
    assert read_views(folder).kind == "Record3D" and all(view.exists for view in read_views(folder).views)


@pytest.mark.parametrize(
    ("write", "reported"),
    [
        (partial(write_polycam, fx="wide"), "fx is \"wide\", a number is needed"),
        (partial(write_polycam, t_00=float("nan")), "t_00 is NaN, a finite number"),
        (partial(write_polycam, width=None), "width is null, a number is needed"),
        (partial(write_scanner, cameraPoseARFrame=[1, 2, 3]), "a list of 3, a list with a length of at least 16"),
        (partial(write_scanner, intrinsics=["a"] * 9), r"intrinsics\[0\] is .a., a number is needed"),
        (partial(write_record3d, poses=[[0, 0, 0, 0, 1, 2, 3]] * 8), "its quaternion is zero"),
        (partial(write_record3d, poses="none"), "poses is .none., a list is needed"),
        (partial(write_record3d, K=[1, 2]), "K is a list of 2, a list with a length of at least 9"),
    ],
)
def test_damaged_exports_are_one_sentence(write: Callable[[Path], Path], reported: str, tmp_path: Path) -> None:
    folder = tmp_path / "scan"
    folder.mkdir()
    write(folder)
    with pytest.raises(CaptureError, match=reported) as caught:
        read_views(folder)
    assert "\n" not in str(caught.value)


def test_an_export_that_was_cut_off_says_so(tmp_path: Path) -> None:
    folder = write_scanner(tmp_path)
    file = folder / "frame_00004.json"
    file.write_text(file.read_text()[:40])
    with pytest.raises(CaptureError, match=r"frame_00004\.json is not readable as JSON: it is empty, cut off"):
        read_views(folder)
