"""Masks of photographs: pixels that do not count are left out, however the masks lie beside the photographs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

from nerfnav.core.steps import run_steps
from nerfnav.importers.captures.config import ImportConfig, ImportedCapture
from nerfnav.importers.captures.importer import import_capture
from nerfnav.importers.captures.views import CaptureError
from tests.importers.captures.synthetic import CAMERA, changed, write_colmap, write_points, write_transforms

SHAPE = (CAMERA.height, CAMERA.width)
COUNTED = np.ones(SHAPE, bool)
COUNTED[5:15, 20:30] = False
"""100 pixels do not count."""
LAYOUTS = (
    "masks/{stem}.png", "masks/{name}.png", "masks/{stem}.PNG", "mask/images/{name}.png", "images/masks/{stem}.png",
    "masks/{stem}.bmp", "images/dynamic_mask_{stem}.png",
)  # fmt: skip


def write_masks(folder: Path, layout: str, counted: np.ndarray = COUNTED, mode: str = "L") -> None:
    for picture in sorted((folder / "images").glob("*.png")):
        path = folder / layout.format(stem=picture.stem, name=picture.name)
        path.parent.mkdir(parents=True, exist_ok=True)
        shown = ~counted if "dynamic" in layout else counted
        Image.fromarray(np.where(shown, np.uint8(255), np.uint8(0))).convert(mode).save(path)


def imported(folder: Path, **options: object) -> ImportedCapture:
    return run_steps(import_capture(folder, ImportConfig(**options)))  # type: ignore[arg-type]


def masked(found: ImportedCapture) -> np.ndarray:
    assert found.learned.mask is not None
    return ~found.learned.mask.numpy()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_masks_are_found_in_every_layout(tmp_path: Path, layout: str) -> None:
    folder = write_transforms(tmp_path)
    write_masks(folder, layout)
    found = imported(folder)
    assert found.report.images_with_mask == 8
    assert (masked(found) == ~COUNTED).all()
    assert found.held_out.mask is not None and bool((found.held_out.mask.numpy() == COUNTED).all())


@pytest.mark.parametrize("mode", ["L", "1", "RGB", "P", "RGBA", "I;16"])
def test_masks_may_have_any_depth_of_colour(tmp_path: Path, mode: str) -> None:
    folder = write_transforms(tmp_path)
    write_masks(folder, "elsewhere/{stem}.png", mode=mode)

    def name_masks(said: dict) -> None:
        for frame in said["frames"]:
            frame["mask_path"] = frame["file_path"].replace("images/", "elsewhere\\")

    assert (masked(imported(changed(folder, name_masks))) == ~COUNTED).all()


def test_a_colmap_capture_has_masks_and_its_points_behind_them_do_not_count(tmp_path: Path) -> None:
    folder = write_colmap(tmp_path, binary=True)
    write_points(folder, True, [((0.0, 0.0, 0.0), 0.5, [1, 2, 3, 4]), ((0.3, 0.2, 0.1), 0.5, [1, 2, 3])])
    everything = imported(folder)
    assert everything.learned.sightings is not None
    write_masks(folder, "masks/{name}.png", counted=np.arange(CAMERA.width) < 3 + np.zeros(SHAPE))
    found = imported(folder)
    assert found.learned.sightings is not None and len(found.learned.sightings) < len(everything.learned.sightings)


def test_a_pixel_of_a_smaller_or_straightened_picture_counts_where_all_its_parts_do(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path, k1=-0.1)
    write_masks(folder, "masks/{stem}.png")
    whole = masked(imported(folder))
    assert 90 <= whole[0].sum() <= 170
    assert masked(imported(folder, downscale=2))[0].sum() >= 25


def test_depth_behind_a_mask_is_not_measured(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path)
    (folder / "depth").mkdir()
    for index in range(8):
        np.save(folder / "depth" / f"{index}.npy", np.full((2, *SHAPE), 2.0, np.float32)[:1])

    def name_depth(said: dict) -> None:
        said["depth_unit_scale_factor"] = 1.0
        for index, frame in enumerate(said["frames"]):
            frame["depth_file_path"] = f"depth/{index}.npy"

    write_masks(folder, "masks/{stem}.png")
    found = imported(changed(folder, name_depth))
    assert found.learned.depth is not None
    assert torch.equal(found.learned.depth[0] == 0, torch.from_numpy(~COUNTED))


def test_pictures_without_a_mask_count_whole(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path)
    write_masks(folder, "masks/{stem}.png")
    (folder / "masks" / "001.png").unlink()
    found = imported(folder)
    assert found.report.images_with_mask == 7 and masked(found)[1].sum() == 0 < masked(found)[0].sum()


def test_masks_that_cannot_be_used_are_one_sentence(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path)
    write_masks(folder, "masks/{stem}.png")
    (folder / "masks" / "003.png").write_bytes(b"nothing")
    with pytest.raises(CaptureError, match=r"the mask .*003\.png of images/003\.png is missing, or no whole picture"):
        imported(folder)
    Image.new("L", (20, 20)).save(folder / "masks" / "003.png")
    with pytest.raises(CaptureError, match="of 20 x 20 pixels has another shape than its picture"):
        imported(folder)
    write_masks(folder, "masks/{stem}.png", counted=np.zeros(SHAPE, bool))
    with pytest.raises(CaptureError, match="leave out every pixel"):
        imported(folder)


def test_a_mask_that_is_named_must_be_there_and_inside(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path / "in")
    changed(folder, lambda said: said["frames"][2].update(mask_path="../other.png"))
    with pytest.raises(CaptureError, match="is missing"):
        imported(folder)
    with pytest.raises(CaptureError, match="outside of its own folder"):
        imported(folder, within=folder)


@pytest.mark.parametrize("name", ["/", "9" * 3000, ".."])
def test_a_name_that_no_file_can_have_is_a_missing_photograph(tmp_path: Path, name: str) -> None:
    def rename(said: dict[str, Any]) -> None:
        said["frames"][1]["file_path"] = name

    whole = imported(write_transforms(tmp_path / "whole"))
    damaged = imported(changed(write_transforms(tmp_path / "scan"), rename))
    assert damaged.report.images_skipped == whole.report.images_skipped + 1
