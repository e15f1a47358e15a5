"""What a training is configured to, by quality."""

from pathlib import Path

import pytest
import torch

from nerfnav.field.train.config import TrainConfig
from nerfnav_app.jobs.field.request import QualityName, TrainRequest
from nerfnav_app.jobs.field.train import config_for
from nerfnav_app.jobs.field.training_data import TrainingData
from tests.field.fields import BOX, black_photographs

PICTURES = black_photographs(12, size=200)  # pixels of a centimetre or two at the box


def material(voxel: float | None, bounded: bool = True) -> TrainingData:
    return TrainingData(
        PICTURES, PICTURES.subset([]), BOX, torch.ones(3), None, {}, voxel=voxel, iterations=900, bounded=bounded
    )


def config(quality: QualityName, voxel: float | None = 0.05, bounded: bool = True) -> TrainConfig:
    return config_for(TrainRequest("a", Path("a.npz"), quality=quality), material(voxel, bounded))


def test_a_draft_is_coarser_and_briefer_and_the_best_finer_and_longer_than_what_is_good() -> None:
    draft, good, best = (config(quality) for quality in ("draft", "good", "best"))
    assert (good.voxel, good.iterations) == (0.05, 900)
    assert draft.voxel == pytest.approx(0.05 * 4 ** (1 / 3)) and draft.iterations == 300
    assert best.voxel == pytest.approx(0.05 * 3 ** (-1 / 3)) and best.iterations == 3600


def test_no_quality_is_finer_than_pixels_unless_the_source_asks_for_it() -> None:
    away = PICTURES.poses.position - (BOX.lower + BOX.upper) / 2
    pixel = float(away.norm(dim=-1).median()) / PICTURES.camera.fx
    assert config("best", 1.2 * pixel).voxel == pytest.approx(pixel, rel=1e-3)
    assert config("best", 0.5 * pixel).voxel == 0.5 * pixel


def test_photographs_of_a_real_place_are_learned_longer_at_best_but_not_finer() -> None:
    best = config("best", bounded=False)
    assert (best.voxel, best.iterations) == (0.05, 3600)


def test_numbers_that_are_given_go_before_quality() -> None:
    request = TrainRequest("a", Path("a.npz"), quality="best", iterations=10, voxel=0.1, budget=5.0)
    best = config_for(request, material(0.05))
    assert (best.iterations, best.voxel, best.budget) == (10, 0.1, 5.0)
