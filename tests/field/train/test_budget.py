"""A budget of wall time holds for all stages of a training, by a clock that slow stages advance."""

import pytest
import torch

from nerfnav.core.deadline import Deadline
from nerfnav.core.steps import run_steps
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof import carving
from nerfnav.field.train import evaluation, loop
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.grid_learner import GridLearner
from nerfnav.field.train.progress import Progress
from tests.clock import Clock
from tests.field.fields import BOX, ball, photographs_of_ball


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


PICTURES = photographs_of_ball(8, size=16)


def trained(clock: Clock, budget: float, picture_s: float, view_s: float, start_s: float = 0.0) -> VoxelField:
    """Train where pictures that prove space free, and views that are rendered, take so long."""
    clock.slow(GridLearner, "step", lambda *_: 0.02 * budget)
    clock.slow(loop, "first_learner", lambda *_: start_s)
    clock.slow(carving, "_carved_once", lambda field, pictures, *_: picture_s * len(pictures))
    full = PICTURES.camera.width * PICTURES.camera.height
    clock.slow(evaluation, "render_image", lambda field, camera, pose: view_s * camera.width * camera.height / full)
    config = TrainConfig(voxel=0.2, budget=budget, rays=64)
    steps = loop.train(PICTURES, PICTURES.subset([0, 1]), BOX, ball().background, config, torch.Generator())
    return run_steps(steps)


@pytest.mark.parametrize(("picture_s", "view_s", "start_s"), [(0.1, 0.1, 0.0), (1.0, 2.0, 10.0), (2.0, 0.0, 30.0)])
def test_training_ends_with_its_evaluation_within_a_tenth_of_its_budget(
    clock: Clock, picture_s: float, view_s: float, start_s: float
) -> None:
    trained(clock, 100.0, picture_s, view_s, start_s)
    assert 90 <= clock.now <= 110


def test_a_budget_that_the_evaluation_takes_up_leaves_the_least_training(clock: Clock) -> None:
    field = trained(clock, 10.0, 10.0, 1.0)
    assert field.info.iterations > 5 and clock.now > 11
    rounds = clock.now / (10.0 * len(PICTURES))
    assert rounds < 3.5, "only the first round is carved"


def test_without_a_budget_iterations_end_the_training(clock: Clock) -> None:
    progress = Progress(4, Deadline())
    for _ in range(4):
        clock.now += 1e6
        progress.learned(0.1, 10)
        progress.reserve(1e9)
    assert progress.fraction == 1 and not progress.has_budget


def test_a_budget_ends_the_training_after_the_least_number_of_steps(clock: Clock) -> None:
    progress = Progress(0, Deadline(10.0), least=40)
    progress.learned(0.1, 10)
    fractions = []
    while progress.fraction < 1:
        clock.now += 3.0
        progress.learned(0.1, 10)
        fractions.append(progress.fraction)
    assert progress.iteration == 40 and fractions == sorted(fractions)


def test_a_part_ends_no_later_than_the_whole(clock: Clock) -> None:
    whole = Deadline(10.0)
    clock.now = 7.0
    assert (whole.left_s, whole.part(2.0).left_s, whole.part(5.0).left_s) == (3.0, 2.0, 3.0)
    clock.now = 11.0
    assert whole.left_s == -1.0 == whole.part(5.0).left_s
