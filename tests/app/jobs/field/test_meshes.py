"""From a mesh file to a field that is judged on it, through the job and the command line."""

import json
import os
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
import torch
import trimesh

from nerfnav.core.errors import FieldFileError, InvalidInputError, NerfnavError
from nerfnav.field.storage.checkpoint import load_field
from nerfnav.field.train.config import TrainConfig
from nerfnav.importers.core.errors import MeshFileError
from nerfnav.importers.core.placement import Placement
from nerfnav.importers.meshes.config import MeshOptions
from nerfnav.robots.state import RigidState
from nerfnav.world.capture import CaptureConfig
from nerfnav.world.contact import judge
from nerfnav_app.cli.main import main
from nerfnav_app.jobs.events import Progress
from nerfnav_app.jobs.field.request import Photographs, TrainRequest
from nerfnav_app.jobs.field.train import run
from nerfnav_app.jobs.field.training_data import StoppedError, TrainingData, gather
from nerfnav_app.places.place import open_place
from tests.app.following import followed, result_of
from tests.importers.meshes.places import two_textures, write

DATA = Path(os.environ.get("NERFNAV_TEST_DATA", "."))
WITH_DATA = pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="NERFNAV_TEST_DATA is not set")


def pillars(folder: Path, at: tuple[float, ...] = (-0.6, 0.0, 0.6)) -> Path:
    """A mesh of up to three pillars on a floor of 2 m, at these x [m]."""
    floor = trimesh.creation.box((2, 2, 0.1)).apply_translation([0, 0, -0.05])
    pillars = [trimesh.creation.box((0.3, 0.3, 0.6)).apply_translation([x, 0, 0.3]) for x in at]
    colors = ([90, 120, 60], [200, 60, 50], [50, 90, 200], [210, 190, 60])
    for mesh, color in zip([floor, *pillars], colors[: 1 + len(at)], strict=True):
        mesh.visual.face_colors = [*color, 255]
    return write(trimesh.util.concatenate([floor, *pillars]), folder / "pillars.ply")


def _request(source: Path, out: Path, **changes: object) -> TrainRequest:
    small = {
        "iterations": 60,
        "photographs": Photographs(30),
        "voxel": 0.06,
        "capture": CaptureConfig(width=40, height=40, supersample=1),
        "placement": Placement(up=(0, 0, 1), scale=1.0),
        "config": TrainConfig(rays=2048, report_every=20),
    }
    return TrainRequest(str(source), out, **small | changes)  # type: ignore[arg-type]


def test_a_mesh_becomes_a_field_with_its_ground_truth_beside_it(tmp_path: Path) -> None:
    out = tmp_path / "pillars.npz"
    events, finished = followed(run(_request(pillars(tmp_path), out)))
    labels = {event.label for event in events if isinstance(event, Progress)}
    assert {"reading the mesh", "finding what is solid", "photographing", "training"} <= labels
    assert finished.files == (out, tmp_path / "pillars.truth.npz")
    source = finished.summary["source"]
    assert source["kind"] == "mesh"
    assert source["solids"] == 4
    assert source["images_used"] == 30
    info = load_field(out).info
    assert (info.source, info.truth) == ("pillars.ply", "pillars.truth.npz")
    place = open_place(str(out))
    assert place.scene is not None
    through = RigidState.stack([RigidState.at_rest((0.0, y, 0.3)) for y in (-0.8, 0.8)])
    between = RigidState.stack([RigidState.at_rest((0.3, y, 0.3)) for y in (-0.8, 0.8)])
    assert judge(place.scene, place.robot.body, through).max_overlap_m3 == pytest.approx(4e-4, rel=1e-3)
    assert judge(place.scene, place.robot.body, between).max_overlap_m3 == 0


def test_a_field_without_its_ground_truth_opens_and_one_with_another_does_not(tmp_path: Path) -> None:
    out = tmp_path / "pillars.npz"
    list(run(_request(pillars(tmp_path), out)))
    truth = tmp_path / "pillars.truth.npz"
    data = truth.read_bytes()
    truth.write_bytes(data + b"0")
    with pytest.raises(FieldFileError, match="not the ground truth"):
        open_place(str(out))
    truth.unlink()
    assert open_place(str(out)).scene is None


def test_info_judges_a_field_by_the_mesh_it_was_made_from_wherever_that_was_put(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, source = tmp_path / "pillars.npz", pillars(tmp_path)
    list(run(_request(source, out, voxel=0.2, placement=Placement(up=(0, 0, 1), scale=4.0))))
    assert main(["info", str(out), "--mesh", str(source), "--json"]) in (0, None)
    geometry = json.loads(capsys.readouterr().out)["geometry"]
    assert geometry["voxel_m"] == pytest.approx(0.2, rel=0.1)
    assert geometry["surface_points"] > 1000
    assert geometry["free_clear"] > 0.5


def test_stopping_while_the_mesh_is_read_says_that_nothing_was_kept(tmp_path: Path) -> None:
    job = run(_request(pillars(tmp_path), tmp_path / "out.npz"))
    next(job)
    next(job)
    with pytest.raises(StoppedError, match="nothing was learned yet"):
        job.send(True)


def test_the_size_of_a_place_does_not_change_how_it_is_photographed_and_learned(tmp_path: Path) -> None:
    source, out = pillars(tmp_path), tmp_path / "out.npz"
    small, large = (
        _material(_request(source, out, voxel=None, placement=Placement(up=(0, 0, 1), scale=scale)))
        for scale in (1.0, 10.0)
    )
    assert small.voxel is not None
    assert small.iterations == large.iterations
    assert len(small.learned) == len(large.learned)
    assert large.voxel == pytest.approx(10 * small.voxel)
    assert torch.equal(small.learned.images[0], large.learned.images[0])


@pytest.mark.slow
def test_the_command_prints_what_it_guessed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["train", str(pillars(tmp_path)), "--out", str(tmp_path / "f.npz"), "--iterations", "30"]
    assert main([*words, "--voxel", "0.02", "--images", "20", "--up", "z", "--units", "ft", "--seen-from", "outside",
                 "--json"]) in (0, None)  # fmt: skip
    source = json.loads(capsys.readouterr().out.splitlines()[-1])["source"]
    assert (source["up"], source["scale"], source["seen_from"]) == ("z", 0.3048, "outside")
    assert source["guesses"] == []


def test_the_command_refuses_what_is_no_mesh_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "letter.glb"
    path.write_text("Dear reader")
    assert main(["train", str(path), "--out", str(tmp_path / "f.npz")]) == 2
    reported = capsys.readouterr().err
    assert "is not a .glb file" in reported
    assert "Traceback" not in reported
    assert not (tmp_path / "f.npz").exists()


@pytest.mark.slow
@WITH_DATA
@pytest.mark.parametrize(
    ("name", "up", "longest", "seen_from"),
    [("stonehenge_chronos.glb", "y", 25.17, "outside"), ("warehouse.glb", "z", 20.92, "inside")],
)
def test_a_mesh_from_elsewhere_trains_and_is_judged(
    name: str, up: str, longest: float, seen_from: str, tmp_path: Path
) -> None:
    out = tmp_path / "place.npz"
    request = TrainRequest(
        str(DATA / name),
        out,
        iterations=40,
        voxel=0.3,
        photographs=Photographs(40),
        capture=CaptureConfig(width=60, height=60, supersample=1),
    )
    finished = result_of(run(request))
    source = finished.summary["source"]
    assert (source["up"], source["seen_from"]) == (up, seen_from)
    assert max(source["size_m"]) == pytest.approx(longest, abs=0.01)
    assert source["solids"] >= 150
    place = open_place(str(out))
    assert place.scene is not None
    solid = max(place.scene.solids, key=lambda mesh: mesh.volume if mesh.is_watertight else 0)
    middle = solid.triangles_center[0].tolist()
    inside = RigidState.stack([RigidState.at_rest(tuple(middle))] * 2)
    assert judge(place.scene, place.robot.body, inside).max_overlap_m3 > 0


def test_a_room_can_be_forced_to_be_open_ground(tmp_path: Path) -> None:
    room = trimesh.creation.box((3, 2, 1))
    room.invert()
    path = write(room, tmp_path / "room.ply")
    request = _request(path, tmp_path / "f.npz", mesh=MeshOptions(seen_from="outside"))
    finished = result_of(run(request))
    assert finished.summary["source"]["seen_from"] == "outside"


def test_a_damaged_mesh_fails_before_anything_is_photographed(tmp_path: Path) -> None:
    path = tmp_path / "empty.stl"
    path.touch()
    with pytest.raises(MeshFileError, match="is empty"):
        list(run(_request(path, tmp_path / "f.npz")))


def _zipped(folder: Path, *names: str) -> Path:
    archive = folder / "place.zip"
    with zipfile.ZipFile(archive, "w") as content:
        for name in names:
            content.write(folder / name, f"inner/{name}")
    return archive


def test_a_mesh_and_its_textures_may_come_in_one_archive(tmp_path: Path) -> None:
    write(two_textures(pbr=False), tmp_path / "two.obj")
    files = [path.name for path in tmp_path.iterdir()]
    request = _request(_zipped(tmp_path, *files), tmp_path / "f.npz")
    finished = result_of(run(request))
    assert (finished.summary["source"]["format"], finished.summary["source"]["textures"]) == ("obj", 2)
    assert load_field(tmp_path / "f.npz").info.source == "two.obj"


def test_an_archive_of_two_meshes_or_a_damaged_one_is_refused_by_its_own_name(tmp_path: Path) -> None:
    for name in ("a.ply", "b.ply"):
        (tmp_path / name).write_bytes(pillars(tmp_path).read_bytes())
    with pytest.raises(InvalidInputError, match=r"place\.zip holds 2 meshes"):
        list(run(_request(_zipped(tmp_path, "a.ply", "b.ply"), tmp_path / "f.npz")))
    (tmp_path / "a.ply").write_text("no mesh")
    with pytest.raises(MeshFileError, match=r"^inner/a\.ply is not a PLY file"):
        list(run(_request(_zipped(tmp_path, "a.ply"), tmp_path / "f.npz")))


def test_an_archive_that_leads_out_of_its_folder_is_refused(tmp_path: Path) -> None:
    archive = tmp_path / "evil.zip"
    with zipfile.ZipFile(archive, "w") as content:
        content.writestr("../evil.ply", pillars(tmp_path).read_bytes())
    with pytest.raises(NerfnavError, match="outside of its own folder"):
        list(run(_request(archive, tmp_path / "f.npz")))


def test_a_short_budget_makes_a_coarse_field(tmp_path: Path) -> None:
    source, voxels = pillars(tmp_path), []
    for budget in (None, 60.0, 0.5):
        request = _request(source, tmp_path / "f.npz", iterations=None, budget=budget, voxel=None)
        voxels.append(_material(request).voxel)
    assert 0.008 < voxels[0] < voxels[1] < voxels[2] < 0.05


def _material(request: TrainRequest) -> TrainingData:
    """What is trained from, of ten photographs."""
    gathering = gather(replace(request, photographs=Photographs(10)))
    while True:
        try:
            next(gathering)
        except StopIteration as end:
            return end.value
