"""Field files: what is written comes back; what is not a field is refused in one sentence."""

import io
import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.core.errors import FieldFileError
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.field.storage.checkpoint import load_field, save_field
from tests.field.fields import random_rays, random_voxels


def test_a_saved_field_comes_back_with_its_colours_and_its_history(tmp_path: Path):
    info = FieldInfo("stonehenge", created="2026-01-01T00:00:00", images=180, psnr_db=27.5, seed=3)
    field = replace(random_voxels(), info=info)
    size = save_field(field, tmp_path / "field.npz")
    loaded = load_field(tmp_path / "field.npz")
    assert size == (tmp_path / "field.npz").stat().st_size
    assert loaded.info == field.info
    assert torch.equal(loaded.box.upper, field.box.upper)
    rays = random_rays(200)
    assert (loaded.render_rays(*rays).color - field.render_rays(*rays).color).abs().mean() < 0.01


def test_empty_space_stays_empty(tmp_path: Path):
    field = random_voxels()
    field.values[..., 0] = EMPTY_RAW
    save_field(field, tmp_path / "field.npz")
    assert load_field(tmp_path / "field.npz").density(torch.zeros(1, 3)).item() < 1e-5


def bad_files(folder: Path) -> dict[str, bytes]:
    save_field(random_voxels(), folder / "whole.npz")
    whole = (folder / "whole.npz").read_bytes()
    foreign = io.BytesIO()
    np.savez(foreign, weights=np.zeros(3))
    return {
        "empty": b"",
        "truncated": whole[: len(whole) // 2],
        "cut at the end": whole[:-30],
        "text": b"hello\n",
        "foreign": foreign.getvalue(),
        "pickle": pickle.dumps({"a": 1}),
    }


@pytest.mark.parametrize("kind", ["empty", "truncated", "cut at the end", "text", "foreign", "pickle"])
def test_what_is_not_a_field_is_refused_in_one_sentence(tmp_path: Path, kind: str):
    path = tmp_path / "bad.npz"
    path.write_bytes(bad_files(tmp_path)[kind])
    with pytest.raises(FieldFileError, match=r"bad\.npz is not a (whole )?nerfnav field") as error:
        load_field(path)
    assert "\n" not in str(error.value)


def test_a_path_may_be_a_string(tmp_path: Path):
    path = str(tmp_path / "field.npz")
    save_field(random_voxels(), path)
    assert torch.equal(load_field(path).box.upper, random_voxels().box.upper)


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(FieldFileError, match=r"there is no field file .*nowhere\.npz"):
        load_field(tmp_path / "nowhere.npz")


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "field.npz"
    save_field(random_voxels(), path)
    before = path.read_bytes()

    def full_disk(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full_disk)
    with pytest.raises(FieldFileError, match="No space left on device"):
        save_field(random_voxels(seed=1), path)
    assert path.read_bytes() == before
    assert [item.name for item in tmp_path.iterdir()] == ["field.npz"]


@pytest.mark.parametrize(
    ("name", "damaged"),
    [
        ("box", np.array([[0.0, 0, 0], [1, 1, np.inf]], np.float32)),
        ("box", np.array([[0.0, 0, 0], [1, 1, 1e9]], np.float32)),
        ("box", np.array([["a"] * 3] * 2)),
        ("box", np.zeros((3, 2), np.float32)),
        ("background", np.array([np.nan, 0, 0], np.float32)),
        ("background", np.zeros(4, np.float32)),
        ("raw", np.zeros((0, 3, 3), np.uint8)),
        ("raw", np.zeros((3, 3, 3), np.float64)),
        ("color", np.zeros(3, np.uint8)),
        ("raw", np.array([{"a": 1}], object)),
    ],
)
def test_a_damaged_array_is_refused_in_one_sentence(tmp_path: Path, name: str, damaged: np.ndarray) -> None:
    save_field(random_voxels(), tmp_path / "bad.npz")
    with np.load(tmp_path / "bad.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "bad.npz", **(arrays | {name: damaged}))  # type: ignore[arg-type]
    with pytest.raises(FieldFileError, match=r"bad\.npz is not a whole nerfnav field") as error:
        load_field(tmp_path / "bad.npz")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("source", 5),
        ("psnr_db", "good"),
        ("camera", 3),
        ("views", [1.0, 2.0]),
        ("placed", [float("nan")] * 13),
        ("guesses", [1]),
    ],
)
def test_a_wrong_value_of_the_header_is_refused(tmp_path: Path, name: str, value: object) -> None:
    save_field(random_voxels(), tmp_path / "bad.npz")
    with np.load(tmp_path / "bad.npz") as file:
        arrays = dict(file)
    header = json.loads(str(arrays["header"]))
    header["info"][name] = value
    np.savez(tmp_path / "bad.npz", **(arrays | {"header": np.array(json.dumps(header))}))  # type: ignore[arg-type]
    with pytest.raises(FieldFileError, match=name):
        load_field(tmp_path / "bad.npz")
