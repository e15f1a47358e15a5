"""TUM's RGB-D sequences: poses and depth by their times."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from nerfnav.core.steps import run_steps
from nerfnav.formats import format_camera
from nerfnav.geometry import Camera, so3
from nerfnav.importers import ImportConfig, import_capture
from nerfnav.importers.captures import tum
from nerfnav.importers.captures.formats import is_capture, read_views
from nerfnav.importers.captures.views import CaptureError
from tests.importers.captures.synthetic import CAMERA, OPENCV_AXES, depth_ahead, matrices, ring, write_pictures

TIME = 1305031102.175304


def write_tum(folder: Path, calibration: bool = True, separator: str = " ", delay: float = 0.004) -> Path:
    """Write a sequence of 8 pictures with depth, whose poses were taken a moment later."""
    poses = ring()
    names = write_pictures(folder, poses)
    (folder / "depth").mkdir()
    rows: dict[str, list[str]] = {"rgb": [], "depth": [], "groundtruth": []}
    for index, (name, pose) in enumerate(zip(names, matrices(poses), strict=True)):
        time, opencv = TIME + index / 30, pose @ OPENCV_AXES
        depth = np.round(5000 * depth_ahead(CAMERA, pose)).astype(np.uint16)
        Image.fromarray(depth).save(folder / "depth" / name)
        w, *xyz = so3.quaternion_from_matrix(torch.from_numpy(opencv[:3, :3])).tolist()
        rows["rgb"].append(separator.join((f"{time:.6f}", f"images/{name}")))
        rows["depth"].append(separator.join((f"{time + delay:.6f}", f"depth/{name}")))
        rows["groundtruth"].append(separator.join(map(repr, (time + delay, *opencv[:3, 3].tolist(), *xyz, w))))
    for name, lines in rows.items():
        (folder / f"{name}.txt").write_text("# a comment\n" + "\n".join(lines) + "\n")
    if calibration:
        (folder / "calibration.json").write_text(format_camera(CAMERA))
    return folder


@pytest.mark.parametrize("separator", [" ", "\t", ","])
def test_pictures_have_the_poses_and_the_depth_of_their_times(tmp_path: Path, separator: str) -> None:
    folder = write_tum(tmp_path, separator=separator)
    found = read_views(folder)
    assert is_capture(folder) and found.kind == "TUM RGB-D" and found.guesses == ()
    np.testing.assert_allclose(np.stack([view.pose for view in found.views]), matrices(ring()), atol=1e-6)
    assert found.views[0].lens.camera(CAMERA.width, CAMERA.height) == CAMERA
    report = run_steps(import_capture(folder, ImportConfig())).report
    assert (report.images_used, report.images_with_depth, report.scale) == (8, 8, 1.0)


def test_without_a_calibration_the_lens_is_the_benchmarks_and_that_is_said(tmp_path: Path) -> None:
    found = read_views(write_tum(tmp_path, calibration=False))
    assert found.views[0].lens.camera(640, 480) == Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
    assert len(found.guesses) == 1 and found.guesses[0].startswith("lens: a focal length of 525 pixels")


def test_of_a_long_sequence_pictures_at_equal_distances_are_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tum, "_MOST", 4)
    found = read_views(write_tum(tmp_path))
    assert [view.name for view in found.views] == [f"images/{index:03}.png" for index in range(0, 8, 2)]
    assert found.guesses == ("pictures: one of 2 is used, of 8 with poses",)


@pytest.mark.parametrize(("file", "change", "said"), [
    ("groundtruth.txt", lambda text: text.replace("1305031102.", "1305031902."), "no picture of .* within 0.02 s"),
    ("groundtruth.txt", lambda text: "1 0 0 0 0 0 0\n", "line 1 of .* has 7 columns, where 8 are needed"),
    ("groundtruth.txt", lambda text: "1 0 0 0 0 0 0 0\n", "holds no pose: its quaternion is zero"),
    ("groundtruth.txt", lambda text: "1 0 0 0 0 0 0 nan\n", "has 'nan' where a number should be"),
    ("groundtruth.txt", lambda text: "2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "line 2 of .*: time must go on"),
    ("groundtruth.txt", lambda text: "", "no picture of"),
    ("depth.txt", lambda text: "1.5\n", "line 1 of .* has 1 columns"),
    ("calibration.json", lambda text: text.replace("48", "-48"), "w is -48, a number at least 1"),
])  # fmt: skip
def test_lists_that_make_no_sense_are_one_sentence(
    tmp_path: Path, file: str, change: Callable[[str], str], said: str
) -> None:
    path = write_tum(tmp_path) / file
    path.write_text(change(path.read_text()))
    with pytest.raises(CaptureError, match=said) as told:
        read_views(tmp_path)
    assert "\n" not in str(told.value)
