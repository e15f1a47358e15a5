"""What others have trained becomes a field in a file, with what was found and guessed."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.models.neural import NeuralField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.checkpoint import load_field
from nerfnav.importers import source_kind
from nerfnav.importers.core.placement import MeasuredDistance, Placement
from nerfnav_app.cli import main as cli
from nerfnav_app.jobs.events import Progress
from nerfnav_app.jobs.open import make_field as adopt
from nerfnav_app.jobs.open.import_field import ImportRequest, run
from nerfnav_app.places.place import open_place
from tests.app.following import followed, result_of
from tests.importers.nerf.test_importer import Flexible, saved
from tests.importers.splat_files import ball_of_splats, write_inria

BOX = ((-0.6, -0.6, -0.6), (0.6, 0.6, 0.6))


def checkpoint(path: Path) -> Path:
    """A network that is solid everywhere, so that rays end soon."""
    torch.manual_seed(0)
    network = Flexible(16, 4, 4, True)
    network.fc_alpha.bias.data[:] = 80.0
    return saved(path, network)


def test_splats_become_a_voxel_field_with_the_splats_beside_it(tmp_path: Path) -> None:
    write_inria(tmp_path / "moon.ply", ball_of_splats(500))
    request = ImportRequest(
        tmp_path / "moon.ply", tmp_path / "moon.npz", voxel=0.04, placement=Placement(up=(0.0, 0.0, 1.0), scale=2.0)
    )
    last = result_of(run(request))
    assert set(last.files) == {tmp_path / "moon.npz", tmp_path / "moon.splats.npz"}
    reported = last.summary["source"]
    assert (reported["declared"], reported["splats"], sum(reported["dropped"].values())) == (500, 500, 0)
    assert reported["up"] == [0, 0, 1] and reported["meters_per_unit"] == 2 and reported["guessed"] == ["box"]
    place = open_place(str(tmp_path / "moon.npz"))
    assert isinstance(place.field, VoxelField) and place.scene is None
    assert place.splats is not None and len(place.splats) == 500
    radii = np.linalg.norm(place.splats.centers, axis=1)
    assert radii.min() > 0.99 and radii.max() < 1.01
    assert place.field.density(torch.tensor([[0.0, 0.0, 1.0]])) > 20 > 1 > place.field.density(torch.zeros(1, 3))


def test_splats_have_their_y_axis_down_where_nobody_says_otherwise(tmp_path: Path) -> None:
    ball = ball_of_splats(500)
    ball.centers[:, 1] -= 3  # high up, in axes whose y points down
    write_inria(tmp_path / "moon.ply", ball)
    last = result_of(run(ImportRequest(tmp_path / "moon.ply", tmp_path / "moon.npz", voxel=0.05)))
    assert last.summary["source"]["guessed"] == ["up", "scale", "box"]
    assert any("up is -y" in guess for guess in last.summary["source"]["guesses"])
    assert load_field(tmp_path / "moon.npz").box.center[2] == pytest.approx(3, abs=0.1)


def test_a_place_of_absurd_size_is_told_to_be_measured(tmp_path: Path) -> None:
    write_inria(tmp_path / "moon.ply", ball_of_splats(500, 600.0))
    last = result_of(run(ImportRequest(tmp_path / "moon.ply", tmp_path / "moon.npz", voxel=30.0)))
    reported = [guess for guess in last.summary["source"]["guesses"] if "measure something" in guess]
    assert len(reported) == 1 and "would be 1.2 km long" in reported[0]
    picked = MeasuredDistance((0.0, 0.0, 0.0), (0.0, 0.0, 600.0), 2.0)
    placement = Placement(picked=picked)
    last = result_of(run(ImportRequest(tmp_path / "moon.ply", tmp_path / "small.npz", voxel=0.1, placement=placement)))
    assert not any("measure something" in guess for guess in last.summary["source"]["guesses"])


@pytest.mark.slow
def test_a_checkpoint_is_baked_unless_its_networks_are_to_be_kept(tmp_path: Path) -> None:
    source = checkpoint(tmp_path / "net.ckpt")
    placement = Placement(box=BOX)
    last = result_of(run(ImportRequest(source, tmp_path / "net.npz", keep_network=True, placement=placement)))
    assert last.summary["source"]["layers"] == 4
    assert isinstance(load_field(tmp_path / "net.npz"), NeuralField)
    events, made = followed(run(ImportRequest(source, tmp_path / "baked.npz", voxel=0.06, placement=placement)))
    fractions = [event.fraction for event in events if isinstance(event, Progress)]
    assert fractions == sorted(fractions) and len(fractions) >= 4
    baked = load_field(tmp_path / "baked.npz")
    assert isinstance(baked, VoxelField)
    psnr = made.summary["baked_psnr_db"]
    assert psnr == baked.info.baked_psnr_db and psnr > 20


@pytest.mark.slow
def test_the_command_line_imports_bakes_and_tells(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, net, baked = checkpoint(tmp_path / "net.ckpt"), tmp_path / "net.npz", tmp_path / "baked.npz"
    corners = [str(number) for corner in BOX for number in corner]
    assert cli.main(["import", str(source), "--out", str(net), "--json", "--keep-network", "--box", *corners]) == 0
    assert json.loads(capsys.readouterr().out)["source"]["kind"] == "nerf-pytorch"
    assert cli.main(["info", str(net), "--json"]) == 0
    reported = json.loads(capsys.readouterr().out)
    assert (reported["layers"], reported["layer_width"]) == (4, 16)
    assert cli.main(["bake", str(net), "--out", str(baked), "--voxel", "0.1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["baked_psnr_db"] > 20
    assert isinstance(load_field(baked), VoxelField)


@pytest.mark.parametrize(
    ("name", "content", "reported"),
    [
        ("a.ckpt", b"", "is empty"),
        ("a.splat", b"short", "truncated or no .splat"),
        ("a.ply", b"solid words", "it is a text STL mesh"),
        ("a.spz", b"ply\nformat", "it is a PLY file"),
        ("a.sog", b"<!DOCTYPE html><html>", "it is a web page"),
        ("a.ksplat", b"version https://git-lfs.github.com/spec/v1", "pointer of Git LFS"),
        ("a.txt", b"words", "is not a trained NeRF or a file of Gaussian splats: it is text"),
        ("a.glb", b"glTF", "is a mesh, and a trained NeRF or a file of Gaussian splats is asked for: `nerfnav train"),
    ],
)
def test_what_cannot_be_imported_is_one_sentence_and_leaves_no_file(
    name: str, content: bytes, reported: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_bytes(content)
    assert cli.main(["import", str(tmp_path / name), "--out", str(tmp_path / "f.npz")]) == cli.BAD_INPUT
    error = capsys.readouterr().err.strip()
    assert reported in error and len(error.splitlines()) == 1
    assert not (tmp_path / "f.npz").exists()


def test_a_source_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="there is no file or folder"):
        list(run(ImportRequest(tmp_path / "nothing.ply", tmp_path / "f.npz")))
    with pytest.raises(InvalidInputError, match="voxel must be a number above 0"):
        ImportRequest(tmp_path / "nothing.ply", tmp_path / "f.npz", voxel=-1.0)


@pytest.mark.slow
def test_what_a_browser_brings_is_imported_where_it_is_splats_or_a_checkpoint(tmp_path: Path) -> None:
    write_inria(tmp_path / "moon.ply", ball_of_splats(300))
    (tmp_path / "mesh.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n")
    sources = tmp_path / "moon.ply", checkpoint(tmp_path / "net.ckpt"), tmp_path / "mesh.ply"
    assert [source_kind(source).command for source in sources] == ["import", "import", "train"]
    last = result_of(adopt.run(tmp_path / "moon.ply", tmp_path / "moon.npz"))
    assert last.summary["source"]["kind"] == "splats"
