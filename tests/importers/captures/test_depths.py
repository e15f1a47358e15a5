"""Depth maps beside photographs: read in any unit, along rays, and refused in one sentence where they are wrong."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.importers.captures.config import ImportConfig, ImportedCapture
from nerfnav.importers.captures.depths import read_depth
from nerfnav.importers.captures.importer import import_capture
from nerfnav.importers.captures.views import CaptureError, DepthFile
from nerfnav.importers.core.placement import Placement
from tests.importers.captures.synthetic import (
    CAMERA,
    RADIUS,
    changed,
    depth_ahead,
    matrices,
    ring,
    write_transforms,
)


def write_depths(folder: Path, size: tuple[int, int] = (24, 18), unit: float = 0.001) -> Path:
    """A whole capture with 16-bit depth maps of half the pictures' size."""
    write_transforms(folder)
    (folder / "depth").mkdir()
    for index, pose in enumerate(matrices(ring())):
        depth = depth_ahead(CAMERA.resized(*size), pose) / unit
        cv2.imwrite(str(folder / "depth" / f"{index}.png"), depth.round().astype(np.uint16))

    def name(said: dict) -> None:
        for index, frame in enumerate(said["frames"]):
            frame["depth_file_path"] = f"depth/{index}.png"

    return changed(folder, name)


def imported(source: Path, config: ImportConfig | None = None) -> ImportedCapture:
    return run_steps(import_capture(source, config or ImportConfig()))


def test_depths_lie_along_rays_and_put_points_where_they_are(tmp_path: Path) -> None:
    found = imported(write_depths(tmp_path), ImportConfig(Placement(up=(0.0, 0.0, 1.0))))
    taken = found.learned
    assert taken.depth is not None and taken.depth.shape == (7, 18, 24) and taken.depth_noise > 0
    origins, directions = taken.depth_camera.rays(taken.poses[0])
    points = origins + taken.depth[0].reshape(-1, 1) * directions
    torch.testing.assert_close(points.norm(dim=-1), torch.full((18 * 24,), RADIUS), atol=2e-3, rtol=0)
    assert found.held_out.depth is not None and found.report.images_with_depth == 8
    # the box holds what they show
    assert found.box.contains(points).float().mean() > 0.9
    assert "what the depth maps show" in found.report.guesses[-1]


def test_the_unit_is_the_files_own_and_scale_holds_for_depths_too(tmp_path: Path) -> None:
    folder = changed(write_depths(tmp_path, unit=0.0002), lambda said: said.update(depth_unit_scale_factor=0.0002))
    placed = imported(folder, ImportConfig(Placement(up=(0.0, 0.0, 1.0), scale=10.0))).learned
    assert placed.depth is not None
    origins, directions = placed.depth_camera.rays(placed.poses[2])
    points = origins + placed.depth[2].reshape(-1, 1) * directions
    torch.testing.assert_close(points.norm(dim=-1), torch.full((18 * 24,), 10 * RADIUS), atol=1e-2, rtol=0)


@pytest.mark.parametrize("axis", [0, -1])
@pytest.mark.parametrize("kind", [np.float16, np.float32, np.uint16])
def test_an_array_of_one_channel_is_a_map(tmp_path: Path, axis: int, kind: type) -> None:
    np.save(tmp_path / "d.npy", np.expand_dims(np.arange(12).reshape(3, 4), axis).astype(kind))
    np.testing.assert_allclose(read_depth(DepthFile(tmp_path / "d.npy", 0.5)), 0.5 * np.arange(12).reshape(3, 4))
    np.save(tmp_path / "d.npy", np.zeros((3, 4, 2), kind))
    with pytest.raises(CaptureError, match="no readable depth map"):
        read_depth(DepthFile(tmp_path / "d.npy"))


def test_the_depth_of_instant_ngp_has_a_unit_of_its_own_and_can_be_switched_off(tmp_path: Path) -> None:
    def rename(said: dict) -> None:
        said["integer_depth_scale"] = said.pop("depth_unit_scale_factor", 0.001)
        for frame in said["frames"]:
            frame["depth_path"] = frame.pop("depth_file_path")

    usual = imported(write_depths(tmp_path)).learned.depth
    found = imported(changed(tmp_path, rename)).learned.depth
    assert usual is not None and found is not None and torch.equal(usual, found)
    changed(tmp_path, lambda said: said.update(enable_depth_loading=False))
    report = imported(tmp_path).report
    assert report.images_with_depth == 0
    assert report.input_keys.ignored["frames[].depth_path"] == "enable_depth_loading is false"


def test_a_frame_without_depth_has_none(tmp_path: Path) -> None:
    folder = changed(write_depths(tmp_path), lambda said: said["frames"][0].pop("depth_file_path"))
    found = imported(folder)
    assert found.learned.depth is not None and (found.learned.depth[0] == 0).all()
    assert found.report.images_with_depth == 7


def test_depth_is_left_unread_where_it_is_not_wanted(tmp_path: Path) -> None:
    assert imported(write_depths(tmp_path), ImportConfig(depth=False)).learned.depth is None


def _tall(folder: Path) -> None:
    cv2.imwrite(str(folder / "depth" / "3.png"), np.full((24, 18), 3000, np.uint16))


def _other_size(folder: Path) -> None:
    cv2.imwrite(str(folder / "depth" / "3.png"), np.full((36, 48), 3000, np.uint16))


def _nan(folder: Path) -> None:
    np.save(folder / "depth" / "3.npy", np.full((18, 24), np.nan, np.float32))
    changed(folder, lambda said: said["frames"][3].update(depth_file_path="depth/3.npy"))


def _other_unit(folder: Path) -> None:
    changed(folder, lambda said: said.update(depth_unit_scale_factor=1.0))


def _no_unit(folder: Path) -> None:
    changed(folder, lambda said: said.update(depth_unit_scale_factor=0.0))


def _coloured(folder: Path) -> None:
    cv2.imwrite(str(folder / "depth" / "3.png"), np.full((18, 24, 3), 30, np.uint8))


def _cut_off(folder: Path) -> None:
    path = folder / "depth" / "3.png"
    path.write_bytes(path.read_bytes()[:60])


def _nothing(folder: Path) -> None:
    for index in range(8):
        cv2.imwrite(str(folder / "depth" / f"{index}.png"), np.zeros((18, 24), np.uint16))


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (_tall, "depth/3.png of 18 x 24 pixels has another shape than its picture"),
        (_other_size, "differ in size"),
        (_nan, "depth/3.npy has depths that are NaN"),
        (_other_unit, "another unit: set depth_unit_scale_factor"),
        (_no_unit, "depth_unit_scale_factor is 0.0, a number above 0"),
        (_coloured, "depth/3.png is no readable depth map"),
        (_cut_off, "depth/3.png is no readable depth map"),
        (_nothing, "hold no depth at all"),
    ],
)
def test_wrong_depth_is_refused_in_one_sentence(
    tmp_path: Path, spoil: Callable[[Path], None], sentence: str
) -> None:
    spoil(write_depths(tmp_path))
    with pytest.raises(CaptureError, match=sentence):
        imported(tmp_path)


def test_depth_outside_of_the_folder_is_not_read_from_what_anybody_brought(tmp_path: Path) -> None:
    folder = write_depths(tmp_path / "inside")
    changed(folder, lambda said: said["frames"][3].update(depth_file_path="../other.png"))
    with pytest.raises(CaptureError, match="outside of its own folder"):
        imported(folder, ImportConfig(within=folder))
