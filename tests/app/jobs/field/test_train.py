"""Training as a job: its events, its end, stopping early."""

from pathlib import Path

import pytest
import torch

from nerfnav.core.errors import InvalidInputError, UnknownNameError
from nerfnav.field.storage.checkpoint import load_field
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.progress import TrainStep
from nerfnav.world.capture import CaptureConfig
from nerfnav_app.jobs.events import Progress
from nerfnav_app.jobs.field.bundled import images_for, iterations_for
from nerfnav_app.jobs.field.request import NeuralOptions, Photographs, TrainRequest
from nerfnav_app.jobs.field.train import run
from nerfnav_app.jobs.field.training_data import StoppedError
from nerfnav_app.places.place import NoTrainedFieldError, field_file, open_place
from nerfnav_app.storage.output_files import OutputError
from tests.app.following import followed, result_of

SMALL = {
    "iterations": 40,
    "voxel": 0.06,
    "photographs": Photographs(images=10),
    "config": TrainConfig(report_every=10),
    "capture": CaptureConfig(width=40, height=40, supersample=1),
}


def request(out: Path, **changes: object) -> TrainRequest:
    return TrainRequest("blocks", out, **SMALL | changes)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_training_tells_its_pictures_and_steps_and_stores_a_field_that_knows_its_scene(tmp_path: Path) -> None:
    out = tmp_path / "blocks.npz"
    events, finished = followed(run(request(out, seed=5)))
    labels = {event.label for event in events if isinstance(event, Progress)}
    assert labels == {"photographing", "training", "judging"}
    assert [event.iteration for event in events if isinstance(event, TrainStep)] == [10, 20, 30, 40]
    field = load_field(out)
    assert finished.summary["psnr_db"] == field.info.psnr_db
    assert finished.summary["voxels"] == field.values[..., 0].numel()
    assert (field.info.source, field.info.seed) == ("blocks", 5)
    place = open_place(str(out))
    assert place.scene is not None
    assert place.scene.name == "blocks"


def test_what_is_learned_so_far_is_a_place_to_plan_in_while_training_goes_on(tmp_path: Path) -> None:
    out = tmp_path / "blocks.npz"
    job = run(request(out, save_every=1e-3))
    event = next(job)
    while not isinstance(event, TrainStep):
        event = next(job)
    assert event.so_far is not None and event.fraction < 1
    place = open_place(str(out))
    assert place.scene is not None and place.scene.name == "blocks"
    assert place.field.info.iterations == event.iteration
    assert place.field.unknown is not None
    job.close()


def test_networks_are_not_stored_before_they_are_trained(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="save-every"):
        request(tmp_path / "f.npz", save_every=1.0, neural=NeuralOptions())


def test_a_training_that_is_asked_to_stop_keeps_what_was_learned(tmp_path: Path) -> None:
    job = run(request(tmp_path / "f.npz", iterations=100_000))
    event = next(job)
    while not isinstance(event, TrainStep):
        event = next(job)
    next(job)  # the progress beside it
    event = job.send(True)
    assert isinstance(event, TrainStep) and event.last
    assert result_of(job).files == (tmp_path / "f.npz",)
    assert load_field(tmp_path / "f.npz").info.iterations < 100


def test_stopping_before_anything_was_learned_says_so(tmp_path: Path) -> None:
    job = run(request(tmp_path / "f.npz"))
    next(job)
    with pytest.raises(StoppedError, match="nothing was learned yet"):
        job.send(True)
    assert not (tmp_path / "f.npz").exists()


def test_a_cancelled_training_leaves_an_old_file_alone(tmp_path: Path) -> None:
    out = tmp_path / "f.npz"
    out.write_text("old")
    job = run(request(out))
    next(job)
    next(job)
    job.close()
    assert out.read_text() == "old"
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.slow
def test_the_same_seed_learns_the_same_field(tmp_path: Path) -> None:
    for name in ("a", "b"):
        list(run(request(tmp_path / name, seed=2)))
    first, second = load_field(tmp_path / "a"), load_field(tmp_path / "b")
    assert torch.equal(first.values, second.values)


def test_what_a_scene_needs_grows_with_its_size() -> None:
    assert iterations_for(1.0) < iterations_for(6.0)
    assert images_for(1.0) < images_for(6.0) <= images_for(1e6) == images_for(1e7)


def test_a_source_that_is_nothing_known_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="known are: apartment, blocks, church, playground, stonehenge"):
        next(run(TrainRequest("atlantis", tmp_path / "f.npz")))
    with pytest.raises(InvalidInputError, match=r"there is no file or folder .*missing\.zip"):
        next(run(TrainRequest(str(tmp_path / "missing.zip"), tmp_path / "f.npz")))
    text = tmp_path / "letter.txt"
    text.touch()
    with pytest.raises(InvalidInputError, match="is not a scene, a mesh, a capture or a video: it is of no kind"):
        next(run(TrainRequest(str(text), tmp_path / "f.npz")))


def test_a_file_that_cannot_be_written_is_refused_before_work(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="it is a folder"):
        next(run(request(tmp_path)))


def test_a_scene_without_a_trained_field_says_how_to_make_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nerfnav_scenes.trained_path", lambda name: tmp_path / f"{name}.npz")
    with pytest.raises(NoTrainedFieldError, match=r"run `nerfnav train blocks --out blocks\.npz`"):
        field_file("blocks")
