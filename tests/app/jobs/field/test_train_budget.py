"""A budget of `nerfnav train` holds from reading to the stored field, by a clock that slow stages advance."""

from pathlib import Path
from typing import Any

import pytest

from nerfnav.field.proof import carving
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.grid_learner import GridLearner
from nerfnav_app.jobs.field import train
from nerfnav_app.jobs.field.request import TrainRequest
from nerfnav_app.jobs.field.training_data import Gathering
from tests.app.following import result_of
from tests.clock import Clock
from tests.importers.captures.synthetic import write_transforms


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def budget_of(
    clock: Clock, folder: Path, budget: float, reading_s: float, monkeypatch: pytest.MonkeyPatch
) -> dict[str, Any]:
    gather = train.gather

    def slow(request: TrainRequest) -> Gathering:
        clock.now += reading_s
        return (yield from gather(request))

    monkeypatch.setattr(train, "gather", slow)
    clock.slow(GridLearner, "step", lambda *_: 0.02 * budget)
    clock.slow(carving, "_carved_once", lambda *_: 0.02 * budget)
    clock.slow(train, "stored", lambda *_: 0.02 * budget)
    source = str(write_transforms(folder / "room"))
    request = TrainRequest(source, folder / "room.npz", budget=budget, voxel=0.3, config=TrainConfig(rays=64))
    return result_of(train.run(request)).summary["budget"]


def test_a_budget_holds_for_all_stages(clock: Clock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spent = budget_of(clock, tmp_path, 100.0, 20.0, monkeypatch)
    assert spent["reading_s"] == 20.0 and spent["asked_s"] == 100.0
    assert 80.0 <= spent["took_s"] <= 110.0 and "exceeded" not in spent


def test_a_budget_that_reading_takes_up_leaves_the_least_training_and_says_so(
    clock: Clock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spent = budget_of(clock, tmp_path, 10.0, 15.0, monkeypatch)
    assert 17.0 <= spent["took_s"] < 25.0 and spent["training_s"] >= 2.0
    assert str(spent["exceeded"]).startswith("a budget of 10 s is too small here")
