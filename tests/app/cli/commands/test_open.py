"""One door: whatever is opened, and whichever command gets the wrong kind, the right one is done or named."""

import os
import time
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.checkpoint import load_field, save_field
from nerfnav.geometry.box import Box
from nerfnav_app.cli import main as cli
from nerfnav_app.jobs.events import JobEvent, JobFailed, PlaceOpened
from nerfnav_app.jobs.open import make_field, opening
from nerfnav_app.jobs.open.import_field import ImportRequest
from nerfnav_app.jobs.open.import_field import run as run_import
from nerfnav_app.jobs.open.make_field import choose_field_path, find_made_field
from nerfnav_app.state import actions as m
from nerfnav_app.state.session import Session
from nerfnav_app.worker.backend import NavigationBackend
from nerfnav_app.worker.running_job import RunningJob
from tests.app.following import result_of
from tests.app.sessions import after
from tests.importers.captures.synthetic import write_transforms
from tests.importers.meshes.places import quad, write
from tests.importers.meshes.test_stray import room
from tests.importers.splat_files import ball_of_splats, bundle_sog, write_ksplat, write_sog, write_spz


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The sentence with which a command line is refused."""
    assert cli.main(words) == cli.BAD_INPUT
    said = capsys.readouterr().err.strip()
    assert len(said.splitlines()) == 1
    return said


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    return write(quad(-1, 1), tmp_path / "house.glb")


@pytest.mark.parametrize("command", [["plan"], ["fly"], ["info"], ["bake", "--out", "b.npz"], ["localize"]])
def test_commands_that_take_fields_name_what_makes_one_of_a_mesh(
    command: list[str], mesh: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    view = tmp_path / "view.png"
    Image.new("RGB", (32, 24)).save(view)
    words = [command[0], str(mesh), *([str(view)] if command[0] == "localize" else []), *command[1:]]
    reported = f"{mesh} is a mesh, and a field is asked for: `nerfnav train {mesh} --out house.npz`"
    assert reported in refused(words, capsys)


def test_training_and_importing_name_each_other(
    mesh: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "f.npz")
    write_spz(tmp_path / "moon.spz", ball_of_splats(50))
    room = write_transforms(tmp_path / "room")
    assert "`nerfnav train" in refused(["import", str(mesh), "--out", out], capsys)
    assert "is a capture" in refused(["import", str(room), "--out", out], capsys)
    assert "`nerfnav import" in refused(["train", str(tmp_path / "moon.spz"), "--out", out], capsys)
    assert "is a field" in refused(["train", str(stored(tmp_path / "field.npz")), "--out", out], capsys)
    assert not Path(out).exists()


@pytest.mark.parametrize("command", ["serve", "open"])
def test_what_cannot_be_opened_is_told_before_a_page_is_up(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "notes.pdf").write_bytes(b"%PDF-1.7")
    assert "is not a field: it is a PDF document" in refused([command, str(tmp_path / "notes.pdf")], capsys)
    assert "there is no file or folder" in refused([command, str(tmp_path / "gone.glb")], capsys)
    assert "there is no field file" in refused([command, str(tmp_path / "gone.npz")], capsys)


def stored(path: Path, source: str = "") -> Path:
    field = VoxelField(Box.of((0, 0, 0), (1, 1, 1)), torch.zeros(4, 4, 4, 4), torch.ones(3))
    save_field(VoxelField(field.box, field.values, field.background, type(field.info)(source=source)), path)
    return path


def test_a_field_that_was_made_of_a_source_before_is_opened_again_and_no_other_is_overwritten(mesh: Path) -> None:
    beside = mesh.with_name("house.npz")
    assert find_made_field(mesh) is None and choose_field_path(mesh) == beside
    stored(beside, "somebody else's")
    assert find_made_field(mesh) is None and choose_field_path(mesh) == mesh.with_name("house-2.npz")
    stored(beside, "house.glb")
    assert find_made_field(mesh) == beside
    later = time.time() + 100
    os.utime(mesh, (later, later))
    assert find_made_field(mesh) is None, "the mesh has changed since"
    beside.write_bytes(b"torn")
    assert find_made_field(mesh) is None


def test_a_field_of_what_lies_in_a_folder_or_archive_is_found_again(mesh: Path, tmp_path: Path) -> None:
    (tmp_path / "model" / "meshes").mkdir(parents=True)
    mesh.rename(tmp_path / "model" / "meshes" / "house.glb")
    with zipfile.ZipFile(tmp_path / "packed.zip", "w") as archive:
        archive.write(tmp_path / "model" / "meshes" / "house.glb", "house/house.glb")
    for source in (tmp_path / "model", tmp_path / "packed.zip"):
        assert find_made_field(source) is None
        assert stored(choose_field_path(source), "house.glb") == find_made_field(source)


def test_folders_have_their_fields_beside_them_under_their_own_names(tmp_path: Path) -> None:
    write_sog(tmp_path / "playbot", ball_of_splats(50))
    for source in (tmp_path / "playbot", tmp_path / "playbot" / "meta.json"):
        assert choose_field_path(source) == tmp_path / "playbot.npz"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["moon.spz", "moon.sog", "moon.ksplat", "moon"])
def test_splats_of_every_layout_are_opened_by_their_path(name: str, tmp_path: Path) -> None:
    writers = {"moon.spz": write_spz, "moon.sog": bundle_sog, "moon.ksplat": write_ksplat, "moon": write_sog}
    writers[name](tmp_path / name, ball_of_splats(400))
    events: list[JobEvent | PlaceOpened | object] = []
    for event in opening.run(str(tmp_path / name)):
        events.append(event)
        if isinstance(event, PlaceOpened):
            break
    opened = events[-1]
    assert isinstance(opened, PlaceOpened) and opened.place.splats is not None
    assert len(opened.place.splats) == 400
    assert load_field(tmp_path / "moon.npz").box.size.max() < 1.5


def test_opening_again_makes_nothing_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_spz(tmp_path / "moon.spz", ball_of_splats(200))
    result_of(run_import(ImportRequest(tmp_path / "moon.spz", tmp_path / "moon.npz", voxel=0.1)))
    monkeypatch.setattr(make_field, "run", lambda *_: pytest.fail("the field is there"))
    assert any(isinstance(event, PlaceOpened) for event in _until_opened(str(tmp_path / "moon.spz")))


def test_a_mesh_with_stray_parts_opens_in_the_box_that_is_offered(tmp_path: Path) -> None:
    """The page offers a button, so its sentence names no option."""
    mesh = room(tmp_path, (0, 60, 0))
    failed = _end_of_opening(m.OpenPlace(str(mesh)))
    assert isinstance(failed, JobFailed) and failed.without is not None and not find_made_field(mesh)
    assert "has 12 faces (far 0) that are 57.85 m away from the rest" in failed.message
    assert "--box" not in failed.message
    opened = _end_of_opening(m.OpenPlace(str(mesh), failed.without))
    assert isinstance(opened, PlaceOpened)
    box = opened.place.field.box
    np.testing.assert_allclose(torch.stack([box.lower, box.upper]), failed.without)


def test_a_mesh_in_an_archive_with_stray_parts_goes_by_the_name_of_its_file(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "packed.zip", "w") as archive:
        archive.write(room(tmp_path, (0, 60, 0)), "house/room.glb")
    failed = _end_of_opening(m.OpenPlace(str(tmp_path / "packed.zip")))
    assert isinstance(failed, JobFailed) and failed.without is not None
    assert failed.message.startswith("house/room.glb has 12 faces")


def _end_of_opening(command: m.OpenPlace) -> JobFailed | PlaceOpened:
    """What the worker reports at the end of opening a place at draft quality, or as soon as it is open."""
    session = after(replace(Session.opening("balls"), quality="draft", job=None), command)
    assert session.job is not None
    running = RunningJob(session.job, NavigationBackend(runs=None), session)
    while not isinstance(event := running.next_event(lambda _: None), JobFailed | PlaceOpened):
        pass
    running.close()
    return event


def _until_opened(what: str) -> list[object]:
    events: list[object] = []
    for event in opening.run(what):
        events.append(event)
        if isinstance(event, PlaceOpened):
            break
    return events
