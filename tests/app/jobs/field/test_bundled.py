"""How often bundled scenes are photographed."""

from collections.abc import Generator
from pathlib import Path

import pytest
import torch

import nerfnav_scenes as scenes
from nerfnav.geometry import PosedImages
from nerfnav.world import CaptureConfig, Scene
from nerfnav_app.jobs.events import JobEvent
from nerfnav_app.jobs.field import bundled
from nerfnav_app.jobs.field.request import TrainRequest
from nerfnav_app.jobs.field.training_data import StoppedError


def asked_for(name: str, depth: bool | None, monkeypatch: pytest.MonkeyPatch) -> int:
    """How many pictures a training of a scene would take."""
    counts: list[int] = []

    def told_only(
        scene: Scene, config: CaptureConfig, generator: torch.Generator
    ) -> Generator[JobEvent, bool | None, PosedImages]:
        counts.append(config.images)
        raise StoppedError("no picture is needed here")
        yield

    monkeypatch.setattr(bundled, "photograph", told_only)
    with pytest.raises(StoppedError):
        next(bundled.gather(TrainRequest(name, Path("unused.npz"), depth=depth)))
    return counts[0]


def test_rooms_want_three_times_as_many_pictures_where_no_depth_proves_what_is_free(monkeypatch: pytest.MonkeyPatch):
    assert asked_for("apartment", None, monkeypatch) == asked_for("apartment", False, monkeypatch)
    assert asked_for("apartment", False, monkeypatch) == 3 * asked_for("apartment", True, monkeypatch)


@pytest.mark.parametrize("name", sorted({*scenes.names()} - {"apartment"}))
def test_places_under_the_sky_want_as_many_with_depth_as_without(name: str, monkeypatch: pytest.MonkeyPatch):
    assert asked_for(name, None, monkeypatch) == asked_for(name, True, monkeypatch)
