"""Points of COLMAP's models, and what becomes of them in a capture."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.importers import ImportConfig, ImportedCapture, import_capture
from nerfnav.importers.captures.formats import read_views
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.core.placement import Placement
from tests.importers.captures.synthetic import Point, matrices, ring, write_colmap, write_points

_POINTS: list[Point] = [
    ((0.1, -0.2, 0.3), 0.4, [1, 2, 3]),
    ((0.2, 0.0, 0.1), 0.4, [1, 2]),
    ((0.3, 0.0, 0.1), 5.0, [1, 2, 3, 4]),
    ((float("nan"), 0.0, 0.1), 0.4, [1, 2, 3, 4]),
    ((0.5, 0.4, 0.0), 1.0, [8, 2, 5, 99, 5]),
    ((0.6, 0.4, 0.0), float("nan"), [8, 2, 5]),
]
"""Two good ones, and what is seen too seldom, off its features, or nowhere."""


def imported(folder: Path, placement: Placement | None = None) -> ImportedCapture:
    return run_steps(import_capture(folder, ImportConfig(placement or Placement())))


@pytest.mark.parametrize("binary", [False, True])
def test_points_that_three_images_agree_on_are_read_with_the_images_that_show_them(
    tmp_path: Path, binary: bool
) -> None:
    tracks = read_views(write_points(write_colmap(tmp_path, binary), binary, _POINTS)).tracks
    assert tracks is not None
    np.testing.assert_array_equal(tracks.points, [(0.1, -0.2, 0.3), (0.5, 0.4, 0.0)])
    assert tracks.names == ("000.png", "001.png", "002.png", "001.png", "004.png", "007.png")
    assert tracks.numbers.tolist() == [0, 0, 0, 1, 1, 1]


def test_a_model_without_points_or_with_bad_ones_alone_brings_none(tmp_path: Path) -> None:
    folder = write_colmap(tmp_path, binary=True)
    assert read_views(folder).tracks is None
    assert read_views(write_points(folder, True, _POINTS[1:4])).tracks is None
    assert imported(folder).learned.sightings is None


def test_points_lie_where_their_cameras_do_whatever_the_world_and_only_in_pictures_that_are_learned(
    tmp_path: Path,
) -> None:
    folder = write_points(write_colmap(tmp_path, True), True, _POINTS)
    found = imported(folder, Placement(up=(0.0, 1.0, 0.0), scale=3.0))
    sightings, place = found.learned.sightings, found.report.placed
    assert sightings is not None and found.report.points == 2
    scale, rotation = place[0], np.array(place[1:10]).reshape(3, 3)
    placed = scale * np.array([(0.1, -0.2, 0.3), (0.5, 0.4, 0.0)]) @ rotation.T + place[10:]
    np.testing.assert_allclose(sightings.points, placed, atol=1e-5)
    kept = [0, 1, 2, 3, 5, 6, 7]  # the one in the middle is held out
    expected = [(image, point) for point, seen in enumerate([[0, 1, 2], [1, 4, 7]]) for image in seen if image in kept]
    reported = [(kept[image], point) for image, point in zip(sightings.image, sightings.point, strict=True)]
    assert [(int(image), int(point)) for image, point in reported] == expected
    # each is three times as far from the cameras that see it as it was in the capture
    away = (found.learned.poses.position[sightings.image] - sightings.points[sightings.point]).norm(dim=-1)
    eyes = ring().position[torch.tensor([image for image, _ in expected])]
    before = eyes - torch.tensor([[(0.1, -0.2, 0.3), (0.5, 0.4, 0.0)][point] for _, point in expected])
    torch.testing.assert_close(away, 3 * before.norm(dim=-1), atol=1e-4, rtol=1e-4)


def capture_of_nerfstudio(folder: Path, turned: float = 0.0) -> Path:
    """A transforms.json beside the COLMAP model that it was made from, moved as nerfstudio does, and then `turned`."""
    write_points(write_colmap(folder, True), True, _POINTS)
    (folder / "colmap").mkdir()
    (folder / "sparse").rename(folder / "colmap" / "sparse")
    applied = np.array([[0.0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])
    moved = applied @ matrices(ring())
    moved[:, 0, 3] += turned
    frames = [
        {"file_path": f"images/{index:03}.png", "transform_matrix": pose.tolist()} for index, pose in enumerate(moved)
    ]
    said = {"w": 48, "h": 36, "fl_x": 40.0, "applied_transform": applied[:3].tolist(), "frames": frames}
    (folder / "transforms.json").write_text(json.dumps(said))
    return folder


def test_points_of_the_model_beside_a_transforms_json_are_read_unless_its_cameras_were_moved(tmp_path: Path) -> None:
    found = read_views(capture_of_nerfstudio(tmp_path / "as it was"))
    assert found.kind == "transforms.json" and found.tracks is not None
    np.testing.assert_array_equal(found.tracks.points, [(0.1, -0.2, 0.3), (0.5, 0.4, 0.0)])
    assert found.tracks.names[:3] == ("images/000.png", "images/001.png", "images/002.png")
    assert read_views(capture_of_nerfstudio(tmp_path / "moved", 0.1)).tracks is None


@pytest.mark.parametrize("share", [0.1, 0.6, 0.99])
def test_points_that_are_cut_off_are_refused(tmp_path: Path, share: float) -> None:
    path = write_points(write_colmap(tmp_path, True), True, _POINTS) / "sparse" / "0" / "points3D.bin"
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(CaptureError, match=r"points3D.bin is cut off, or no COLMAP model"):
        read_views(tmp_path)


@pytest.mark.parametrize("line", ["1 2 3", "1 0 0 zero 1 2 3 0.5 1 2", "1 0 0 0 1 2 3 0.5 a b"])
def test_lines_of_points_that_make_no_sense_are_refused(tmp_path: Path, line: str) -> None:
    (write_colmap(tmp_path, binary=False) / "sparse" / "0" / "points3D.txt").write_text(line + "\n")
    with pytest.raises(CaptureError, match=r"points3D.txt has a line that describes no point"):
        read_views(tmp_path)
