"""Captures as what a field is trained from: folders, files and archives, through the job that everything uses."""

import os
import shutil
from contextlib import suppress
from pathlib import Path

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.storage.checkpoint import load_field
from nerfnav.field.train.config import TrainConfig
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.core.placement import Placement
from nerfnav.importers.meshes.config import MeshOptions
from nerfnav.importers.sfm import posing
from nerfnav_app.cli.main import BAD_INPUT, main
from nerfnav_app.jobs.events import Progress, SurfaceShaped
from nerfnav_app.jobs.field.captures import NODES, frames_in, gather
from nerfnav_app.jobs.field.request import Photographs, TrainRequest
from nerfnav_app.jobs.field.train import run
from nerfnav_app.jobs.field.training_data import StoppedError
from nerfnav_app.jobs.open import make_field as adopt
from nerfnav_app.places.sources import BUDGETS_S, USUAL
from nerfnav_app.places.surface_glb import read_box
from tests.app.following import followed, result_of
from tests.importers.captures.synthetic import changed, write_transforms
from tests.importers.captures.test_video import shaky, write_video
from tests.importers.sfm import fake_posing


def zipped(folder: Path) -> Path:
    return Path(shutil.make_archive(str(folder), "zip", folder))


def request(source: Path, out: Path, **changes: object) -> TrainRequest:
    quick = {"iterations": 20, "voxel": 0.2, "config": TrainConfig(report_every=10, rays=512)}
    return TrainRequest(str(source), out, **quick | changes)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["folder", "transforms.json", "zip"])
def test_a_capture_becomes_a_field_whichever_way_it_is_given(tmp_path: Path, kind: str) -> None:
    folder = write_transforms(tmp_path / "room")
    source = {"folder": folder, "transforms.json": folder / "transforms.json", "zip": zipped(folder)}[kind]
    events, finished = followed(run(request(source, tmp_path / "room.npz")))
    labels = {event.label for event in events if isinstance(event, Progress)}
    assert labels == {"reading photographs", "training", "judging"}
    report = finished.summary["source"]
    assert (report["kind"], report["images_used"], report["images_skipped"]) == ("capture (transforms.json)", 8, 0)
    assert report["scale"] == 1.0 and report["up"] == (0, 0, 1) and len(report["guesses"]) == 3
    field = load_field(tmp_path / "room.npz")
    assert field.info.source == f"capture {source.name}" and field.info.images == 7
    assert field.info.psnr_db == finished.summary["psnr_db"]


def test_what_is_asked_of_a_capture_reaches_its_import(tmp_path: Path) -> None:
    asked = request(
        write_transforms(tmp_path / "room"),
        tmp_path / "f.npz",
        photographs=Photographs(downscale=2, held_out_every=4),
        placement=Placement(scale=2.0, box=((-1, -1, -1), (1, 1, 1))),
    )
    finished = result_of(run(asked))
    report = finished.summary["source"]
    assert (report["scale"], report["image_size"], report["images_held_out"]) == (2.0, (24, 18), 2)
    assert load_field(tmp_path / "f.npz").box.upper.tolist() == [1, 1, 1]


def test_photographs_of_a_room_are_not_bounded_and_ask_for_a_voxel_by_their_box(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path)
    gathering = gather(TrainRequest(str(folder), tmp_path / "f.npz"))
    with pytest.raises(StopIteration) as end:
        while True:
            next(gathering)
    material = end.value.value
    assert not material.bounded and material.truth is None
    assert material.box.size.prod() / material.voxel**3 == pytest.approx(NODES, rel=1e-3)
    assert not torch.equal(material.background, torch.ones(3))


def test_a_stop_while_reading_says_that_nothing_is_kept(tmp_path: Path) -> None:
    job = run(request(write_transforms(tmp_path / "room"), tmp_path / "f.npz"))
    next(job)
    next(job)
    with pytest.raises(StoppedError, match="nothing was learned yet"):
        job.send(True)


def test_what_is_unpacked_is_gone_afterwards_even_when_cancelled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = zipped(write_transforms(tmp_path / "room"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    gathering = gather(request(source, tmp_path / "f.npz"))
    next(gathering)
    assert list((tmp_path / "temporary").iterdir())
    gathering.close()
    assert not list((tmp_path / "temporary").iterdir())


def test_a_video_is_posed_in_view_and_its_frames_are_the_capture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(posing, "pose_pictures", fake_posing.pose_all)
    source = write_video(tmp_path / "walk.avi", shaky(60, 5))
    events, material = [], None
    gathering = gather(request(source, tmp_path / "f.npz"))
    with pytest.raises(StopIteration) as end:
        while True:
            events.append(next(gathering))
    material = end.value.value
    assert (material.report["frames"], material.report["frames_posed"], material.report["images_used"]) == (12, 10, 10)
    shown = [event for event in events if isinstance(event, SurfaceShaped)]
    assert len(shown) == 5 and all(event.rough and read_box(event.glb) is not None for event in shown)
    labels = [event.label for event in events if isinstance(event, Progress)]
    assert "10 of 12 frames posed" in labels and labels[-1] == "reading photographs"


def test_a_video_that_cannot_be_posed_is_bad_input_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(posing, "pose_pictures", fake_posing.pose_few)
    source = write_video(tmp_path / "walk.avi", shaky(60, 5))
    assert main(["train", str(source), "--out", str(tmp_path / "f.npz")]) == BAD_INPUT
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert f"2 of 12 frames of {source}" in line and "walk around the things that you film" in line
    assert not (tmp_path / "f.npz").exists()


def test_frames_of_a_video_follow_from_the_budget() -> None:
    assert [frames_in("best", budget) for budget in (None, 5.0, 90.0, 1e4)] == [150, 40, 120, 150]
    for quality, budget in BUDGETS_S.items():
        assert frames_in(quality, budget) == frames_in(quality, None), "a draft and its refinement share their world"


def test_posing_that_is_stopped_or_cancelled_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(posing, "pose_pictures", fake_posing.wait)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    source = write_video(tmp_path / "walk.avi", shaky(60, 5))
    for stop in (lambda job: job.close(), lambda job: job.send(True)):
        job = run(request(source, tmp_path / "f.npz"))
        while not (isinstance(event := next(job), Progress) and event.label.startswith("finding features: 3")):
            continue
        assert list(tmp_path.glob("nerfnav-*"))
        with suppress(StoppedError):
            stop(job)
        assert not list(tmp_path.glob("nerfnav-*"))


def test_errors_in_an_archive_name_its_files_and_not_where_they_were_unpacked(tmp_path: Path) -> None:
    folder = changed(write_transforms(tmp_path / "room"), lambda said: said.update(fl_x=0))
    with pytest.raises(CaptureError, match="fl_x is 0, a number above 0 is needed"):
        list(run(request(zipped(folder), tmp_path / "f.npz")))
    (folder / "transforms.json").write_text("nothing")
    with pytest.raises(CaptureError, match=r"room\.zip: transforms\.json is not readable as JSON"):
        list(run(request(zipped(folder), tmp_path / "f.npz")))


def test_an_archive_may_not_name_photographs_of_others(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path / "room")
    secret = (folder / "images" / "000.png").rename(tmp_path / "secret.png")
    changed(folder, lambda said: said["frames"][0].update(file_path=str(secret)))
    with pytest.raises(CaptureError, match="outside of its own folder"):
        list(run(request(zipped(folder), tmp_path / "f.npz")))


@pytest.mark.slow
def test_an_upload_is_learned_within_its_budget(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for quality in ("draft", USUAL):
        monkeypatch.setitem(BUDGETS_S, quality, 0.5)
    result_of(adopt.run(zipped(write_transforms(tmp_path / "room")), tmp_path / "room.npz"))
    assert load_field(tmp_path / "room.npz").info.images == 7


def test_options_that_mean_nothing_for_a_source_are_refused_and_not_passed_over(tmp_path: Path) -> None:
    room = str(write_transforms(tmp_path / "room"))
    for changes, message in (
        ({"mesh": MeshOptions(units="cm")}, "units means nothing for a capture"),
        ({"photographs": Photographs(images=20)}, "images means nothing for a capture"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            list(run(TrainRequest(room, tmp_path / "f.npz", **changes)))  # type: ignore[arg-type]
    for placement in (Placement(scale=2.0), Placement(up=(0, 1, 0)), Placement(box=((0, 0, 0), (1, 1, 1)))):
        with pytest.raises(InvalidInputError, match="means nothing for a bundled scene, which blocks is"):
            list(run(TrainRequest("blocks", tmp_path / "f.npz", placement=placement)))


def test_an_archive_whose_table_is_broken_is_refused(tmp_path: Path) -> None:
    path = zipped(write_transforms(tmp_path / "room"))
    path.write_bytes(path.read_bytes().replace(b"PK\x01\x02", b"PK\x01\x09"))
    with pytest.raises(CaptureError, match=r"no readable \.zip"):
        list(run(TrainRequest(str(path), tmp_path / "f.npz")))


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"downscale": 0}, "downscale must be a number above 0"),
        ({"held_out_every": 1}, "at least every second photograph"),
        ({"images": 3}, "images must be at least 10"),
    ],
)
def test_numbers_that_no_training_can_have_are_refused(entries: dict[str, int], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        Photographs(**entries)


@pytest.mark.slow
@pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="photographs of others are not part of the project")
def test_real_photographs_become_a_field_and_what_is_around_it(tmp_path: Path) -> None:
    source = Path(os.environ["NERFNAV_TEST_DATA"]) / "fox"
    asked = TrainRequest(
        str(source), tmp_path / "fox.npz", iterations=120, voxel=0.15, photographs=Photographs(downscale=16),
        config=TrainConfig(rays=2048, outside=32),
    )  # fmt: skip
    finished = result_of(run(asked))
    assert finished.summary["psnr_db"] > 16
    assert finished.summary["source"]["images_skipped"] == 17
    assert load_field(tmp_path / "fox.npz").outside is not None  # what lies around the box was learned too
