"""Training: a picture goes in, the same picture comes out, always in the same way."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.core.jit import default_threads
from nerfnav.core.steps import run_steps
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.train import loop, trained_grid
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.grid_learner import GridLearner
from nerfnav.field.train.loop import train
from nerfnav.field.train.progress import TrainStep
from nerfnav.field.train.rays import RaySampler
from nerfnav.field.train.trained_grid import views_of, views_of_nodes
from nerfnav.geometry.grid import node_positions
from tests.clock import Clock
from tests.collected_steps import collect
from tests.field.fields import BOX, ball, photographs_of_ball

CONFIG = TrainConfig(voxel=0.05, iterations=300, rays=1024, report_every=50)


def run(config: TrainConfig = CONFIG, seed: int = 0) -> tuple[list[TrainStep], VoxelField]:
    generator = torch.Generator().manual_seed(seed)
    photographs, held_out = photographs_of_ball(24), photographs_of_ball(4, turn=0.7)
    return collect(train(photographs, held_out, BOX, ball().background, config, generator))


@pytest.fixture(scope="module")
def trained() -> tuple[list[TrainStep], VoxelField]:
    """A training with the first seed."""
    return run()


@pytest.mark.slow
def test_a_ball_is_learned_from_its_pictures(trained: tuple[list[TrainStep], VoxelField]):
    steps, field = trained
    assert steps[-1].psnr_db > 25
    assert field.info.psnr_db == steps[-1].psnr_db
    assert field.info.noise_std is not None and 0 < field.info.noise_std < 0.06
    on_the_skin = field.density(torch.tensor([[0.28, 0.0, 0.0], [0.0, -0.28, 0.0]]))
    far_away = field.density(torch.tensor([[0.7, 0.7, 0.4], [-0.8, 0.0, 0.0]]))
    assert on_the_skin.min() > 20
    assert far_away.max() < 1


@pytest.mark.slow
def test_progress_counts_up_to_the_end(trained: tuple[list[TrainStep], VoxelField]):
    steps, _ = trained
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions) and fractions[-1] == 1
    assert [step.last for step in steps] == [False] * (len(steps) - 1) + [True]
    assert all(step.rays_per_s > 0 for step in steps)


@pytest.mark.slow
def test_pictures_of_a_training_sharpen_and_change_nothing_in_it():
    brief = replace(CONFIG, iterations=120, rays=512, report_every=20)
    (_, alone), (steps, field) = run(brief), run(replace(brief, picture_every=1e-9))
    first, *_, last = (step.picture for step in steps if step.picture is not None)
    photograph = photographs_of_ball(24).images[0].numpy().astype(float)
    errors = [np.square(picture - photograph).mean() for picture in (first, last)]
    assert last.shape == photograph.shape and errors[1] < 0.5 * errors[0]
    assert torch.equal(field.values, alone.values)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_field_bit_for_bit():
    brief = replace(CONFIG, iterations=80, rays=512)
    first, second, other = (run(brief, seed)[1] for seed in (0, 0, 1))
    assert torch.equal(first.values, second.values), f"with {default_threads()} threads"
    assert not torch.equal(first.values, other.values)


def test_asking_to_stop_gives_the_field_so_far():
    generator = torch.Generator().manual_seed(0)
    steps = train(photographs_of_ball(8), photographs_of_ball(1).subset([]), BOX, ball().background, CONFIG, generator)
    assert not next(steps).last
    assert steps.send(True).last
    field = run_steps(steps)
    assert field.info.iterations == 50
    assert field.info.psnr_db is None  # nothing was held out


@pytest.mark.slow
def test_fields_of_what_is_learned_so_far_can_be_planned_in_and_change_nothing():
    brief = replace(CONFIG, iterations=60, rays=256, report_every=20)
    (_, plain), (steps, last) = run(brief), run(replace(brief, field_every=1e-3))
    on_the_way = [step.so_far for step in steps[:-1] if step.so_far is not None]
    assert len(on_the_way) >= 20 and steps[-1].so_far is None
    assert torch.equal(last.values, plain.values)
    assert on_the_way[0].shape < on_the_way[-1].shape == last.shape
    for field in on_the_way[::10]:
        assert field.evidence is not None and field.info.psnr_db is not None and field.info.noise_std is not None
    assert on_the_way[0].info.iterations < 10, "time counts from the end of the first step"


@pytest.mark.slow
def test_from_the_given_share_on_only_colours_are_learned():
    config = replace(CONFIG, iterations=40, rays=256, firm_from=0.3, field_every=1e-9)
    steps, last = run(config)
    fields = [*(step.so_far for step in steps if step.fraction > 0.8 and step.so_far is not None), last]
    assert len(fields) > 5
    assert all(torch.equal(field.values[..., 0], fields[0].values[..., 0]) for field in fields)
    assert not torch.equal(fields[0].values[..., 1:], fields[-1].values[..., 1:])


def test_a_budget_ends_training_in_time(monkeypatch: pytest.MonkeyPatch):
    clock = Clock(monkeypatch)
    clock.slow(GridLearner, "step", lambda *_: 0.02)
    clock.slow(loop, "evaluate_grid", lambda *_: 0.15)
    steps, field = run(TrainConfig(voxel=0.04, budget=1.0, rays=512))
    assert steps[-1].fraction == 1
    assert 0.8 <= field.info.train_s < 7.0, "finishing has its share of the budget"


def test_nodes_that_more_cameras_see_learn_faster():
    share = views_of(node_positions(BOX, (5, 5, 5)), photographs_of_ball(12))
    assert share.max() == 1
    assert share[2, 2, 2] == 1
    assert share[0, 0, 4] < 1


def test_large_grids_interpolate_how_many_cameras_see_a_node(monkeypatch: pytest.MonkeyPatch):
    shape, photographs = (21, 18, 24), photographs_of_ball(12)
    exact = views_of(node_positions(BOX, shape), photographs)
    assert torch.equal(views_of_nodes(BOX, shape, photographs), exact)
    monkeypatch.setattr(trained_grid, "_MOST_ASKED", 200)
    coarse = views_of_nodes(BOX, shape, photographs)
    assert coarse.shape == exact.shape and not torch.equal(coarse, exact)
    assert (coarse - exact).abs().mean() < 0.08 < exact.mean()


def test_training_rays_are_those_of_the_camera():
    photographs = photographs_of_ball(3, size=8)
    batch = RaySampler(photographs, torch.Generator().manual_seed(0)).draw(500)
    known = {}
    for index, image in enumerate(photographs.images):
        origins, directions = photographs.camera.rays(photographs.poses[index])
        for origin, direction, color in zip(origins, directions, image.reshape(-1, 3) / 255, strict=True):
            known[tuple((direction * 1e4).round().tolist())] = (origin, color)
    for origin, direction, target in zip(batch.origins, batch.directions, batch.targets, strict=True):
        expected_origin, expected_color = known[tuple((torch.from_numpy(direction) * 1e4).round().tolist())]
        torch.testing.assert_close(torch.from_numpy(origin), expected_origin)
        torch.testing.assert_close(torch.from_numpy(target), expected_color)


def test_patches_are_neighbouring_pixels_of_one_picture_that_hold_one_that_is_asked_for():
    photographs = photographs_of_ball(3, size=8)
    asked = torch.zeros(3, 8, 8, dtype=torch.bool)
    asked[1, 0, 0] = asked[2, 5, 6] = True
    generator = torch.Generator().manual_seed(0)
    batch = RaySampler(photographs, generator, asked).draw(4 * 200 + 3, patch=2)
    assert len(batch.targets) == 4 * 200
    directions = [photographs.camera.rays(photographs.poses[index])[1].reshape(8, 8, 3) for index in range(3)]
    corners = set()
    for rays in torch.from_numpy(batch.directions).reshape(200, 4, 3):
        image = 1 if (directions[1][:2, :2].reshape(4, 3) - rays).abs().max() < 1e-5 else 2
        (top, left), *_ = ((directions[image] - rays[0]).abs().amax(-1) < 1e-5).nonzero().tolist()
        assert (directions[image][top : top + 2, left : left + 2].reshape(4, 3) - rays).abs().max() < 1e-5
        assert asked[image, top : top + 2, left : left + 2].any()
        corners.add((image, top, left))
    assert corners == {(1, 0, 0), (2, 4, 5), (2, 4, 6), (2, 5, 5), (2, 5, 6)}
