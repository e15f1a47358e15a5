"""Maps as the command line writes them, and as the page offers them."""

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.field.core.occupancy import Occupancy
from nerfnav.field.storage.checkpoint import load_field, save_field
from nerfnav.planner.space.scales import threshold_of
from nerfnav_app.cli.main import BAD_INPUT, main
from nerfnav_app.jobs.events import FileMade
from nerfnav_app.jobs.export.occupancy_map import MapRequest, download, run
from tests.app.doubles import balls_place
from tests.app.following import result_of
from tests.field.models.test_neural import random_field

FIELD = balls_place().field


def mapped(capsys: pytest.CaptureFixture[str], *words: str) -> dict:
    assert main(["map", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out.splitlines()[-1])


def test_a_field_becomes_voxels_that_say_what_planners_believe(
    tmp_path: Path, field_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "map.npz"
    numbers = mapped(capsys, str(field_file), "--out", str(out))
    with np.load(out, allow_pickle=False) as read:
        state, lower, voxel = read["state"], read["lower"], float(read["voxel"])
    assert numbers["shape"] == list(state.shape) and numbers["voxel_m"] == voxel
    assert numbers["solid_share"] == pytest.approx((state == Occupancy.SOLID).mean()) and numbers["solid_share"] > 0
    assert numbers["files"] == [str(out)]
    field = load_field(field_file)
    solid = torch.from_numpy(lower + voxel * (np.argwhere(state == Occupancy.FREE) + 0.5)).float()
    assert (field.density(solid) <= threshold_of(field)).all()


def test_a_map_of_ros_is_two_files_beside_each_other(
    tmp_path: Path, field_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    numbers = mapped(capsys, str(field_file), "--out", str(tmp_path / "floor.yaml"), "--voxel", "0.05")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["floor.pgm", "floor.yaml"]
    assert set(numbers["files"]) == {str(tmp_path / "floor.pgm"), str(tmp_path / "floor.yaml")}
    assert numbers["voxel_m"] == 0.05


def test_a_mesh_is_one_file(tmp_path: Path, field_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    numbers = mapped(capsys, str(field_file), "--out", str(tmp_path / "map.glb"))
    assert numbers["files"] == [str(tmp_path / "map.glb")]
    assert (tmp_path / "map.glb").read_bytes()[:4] == b"glTF"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--out", "map.NPZ"], "known are: .glb, .npz, .pgm, .yaml"),
        (["--out", "map.stl"], "known are: .glb, .npz, .pgm, .yaml"),
        (["--out", "map"], "known are: .glb, .npz, .pgm, .yaml"),
        (["--out", "map.npz", "--height", "0.1"], "a height is for .pgm and .yaml alone"),
        (["--out", "map.pgm", "--height", "77"], "there is no slice at 77 m"),
        (["--out", "map.npz", "--voxel", "0"], "voxel must be a number above 0, not 0"),
        (["--out", "/proc/map.npz"], "cannot write"),
    ],
)
def test_what_makes_no_sense_gets_one_sentence(
    tmp_path: Path,
    field_file: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    sentence: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["map", str(field_file), *words]) == BAD_INPUT
    said = capsys.readouterr().err.strip()
    assert sentence in said and "\n" not in said
    assert not list(tmp_path.iterdir())


def test_networks_are_to_be_baked_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_field(random_field(), tmp_path / "nerf.npz")
    assert main(["map", str(tmp_path / "nerf.npz"), "--out", str(tmp_path / "map.npz")]) == BAD_INPUT
    assert "bake this one first, with nerfnav bake" in capsys.readouterr().err


def taken(ending: str, stem: str = "column-map") -> FileMade:
    (made,) = (event for event in download(FIELD, MapRequest(Path(stem + ending))) if isinstance(event, FileMade))
    return made


def test_a_map_to_take_away_is_the_file_that_the_command_line_writes(tmp_path: Path) -> None:
    result = result_of(run(FIELD, MapRequest(tmp_path / "column-map.npz")))
    made = taken(".npz")
    assert made.name == "column-map.npz"
    with np.load(io.BytesIO(made.content)) as reported, np.load(result.files[0]) as written:
        assert reported.files == written.files == ["state", "lower", "voxel"]
        assert all((reported[name] == written[name]).all() for name in reported.files)


def test_a_map_of_two_files_is_taken_away_as_one_archive() -> None:
    made = taken(".pgm")
    assert made.name == "column-map.zip"
    with zipfile.ZipFile(io.BytesIO(made.content)) as packed:
        assert packed.namelist() == ["column-map.pgm", "column-map.yaml"]
        assert packed.read("column-map.pgm").startswith(b"P5")
        assert b'image: "column-map.pgm"' in packed.read("column-map.yaml")
