"""What cannot be trained from is refused before training begins, in one sentence."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav.core import memory
from nerfnav.core.errors import InvalidInputError
from nerfnav.field.train import loop
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.loop import train
from nerfnav.geometry.box import Box
from nerfnav.geometry.images import PosedImages
from tests.field.fields import BOX, photographs_of_ball

CONFIG = TrainConfig(voxel=0.1, iterations=2, rays=16)


def refused(photographs: PosedImages, box: Box = BOX, config: TrainConfig = CONFIG) -> str:
    with pytest.raises(InvalidInputError) as error:
        next(train(photographs, photographs.subset([]), box, torch.ones(3), config, torch.Generator()))
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_images_are_refused(count: int):
    assert "at least 2" in refused(photographs_of_ball(3, size=8).subset(list(range(count))))


def test_poses_that_are_not_finite_are_refused_by_number():
    photographs = photographs_of_ball(4, size=8)
    photographs.poses.position[2, 1] = torch.nan
    assert "image 2 is not finite" in refused(photographs)


def test_poses_that_do_not_turn_are_refused_by_number():
    photographs = photographs_of_ball(4, size=8)
    photographs.poses.rotation[1] *= 2
    assert "image 1 is no rotation" in refused(photographs)


def test_an_empty_box_is_refused():
    assert "is empty" in refused(photographs_of_ball(3, size=8), Box.of((0, 0, 0), (1, 0, 1)))


def test_what_memory_cannot_hold_is_refused_with_both_numbers(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(memory, "available_memory", lambda: 10**6)
    message = refused(photographs_of_ball(3, size=8), config=replace(CONFIG, voxel=0.02))
    assert "GB" in message and "larger voxel" in message


_PEAK = """
import numba, resource, torch  # numba first: a library that is loaded with the first kernel is no part of training
from nerfnav.field.train.grid_learner import GridLearner, LearningRates
from nerfnav.field.train.rays import RaySampler
from nerfnav.field.train.training_volume import TrainingVolume
from tests.field.fields import BOX, photographs_of_ball
photographs = photographs_of_ball(2, size=8)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
learner = GridLearner.start(TrainingVolume(BOX, torch.ones(3), 1.0), (97, 97, 97), photographs, 2)
learner.step(RaySampler(photographs, torch.Generator().manual_seed(0)).draw(4096), LearningRates(0.1, 0.1, 0.0))
print(1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="ru_maxrss has another unit elsewhere")
def test_training_takes_no_more_memory_than_is_said():
    root = Path(__file__).parents[3]
    for _ in range(2):  # the first run may compile kernels, which takes memory of its own
        done = subprocess.run([sys.executable, "-c", _PEAK], capture_output=True, text=True, cwd=root)
        assert done.returncode == 0, done.stderr
    compiled = 120_000_000  # what the kernels' machine code and libraries may take
    assert int(done.stdout) < loop.training_bytes(100**3, 2) + compiled
