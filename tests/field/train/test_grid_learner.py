"""A training step: the kernels' gradients against autograd, and the torch learner against the kernels."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.field.core.protocol import uniform_samples
from nerfnav.field.kernels.learn import parts_above
from nerfnav.field.models.voxel import VoxelField, occupied_blocks
from nerfnav.field.render.surroundings import Surroundings
from nerfnav.field.render.volume_rendering import render_rays
from nerfnav.field.train.grid_learner import GridLearner, LearningRates
from nerfnav.field.train.rays import PointBatch, RayBatch
from nerfnav.field.train.torch_learner import TorchLearner
from nerfnav.field.train.trained_grid import TrainedGrid, training_bytes
from nerfnav.field.train.training_volume import Finish
from tests.field.fields import BOX, random_rays, random_voxels, random_voxels_in_a_room

RATES = LearningRates(0.25, 0.03, 1e-3, 1e-6, 1e-5)
CPU = torch.device("cpu")


def batch_of(count: int, seed: int = 3, jitter: float = 0.0) -> RayBatch:
    origins, directions = random_rays(count, seed)
    generator = torch.Generator().manual_seed(seed)
    targets = torch.rand(count, 3, generator=generator).numpy()
    moved = jitter * (torch.rand(count, generator=generator).numpy() - np.float32(0.5))
    return RayBatch(origins.numpy(), directions.numpy(), targets, moved)


def relative(found: torch.Tensor, wanted: torch.Tensor) -> float:
    return float((found - wanted).abs().max() / wanted.abs().max())


def test_the_compiled_gradient_equals_autograd_through_the_renderer_in_the_box_and_around_it():
    field, batch = random_voxels_in_a_room(), batch_of(200)
    learner = GridLearner.of(field, 1.0, workers=2)
    error = learner.gradient(batch, 0.0)
    values, around = (part.clone().requires_grad_() for part in (field.values, field.outside.values))
    leaf = VoxelField(BOX, values, field.background, outside=Surroundings(around))
    rays = torch.from_numpy(batch.origins), torch.from_numpy(batch.directions)
    color = render_rays(leaf, *rays, uniform_samples(BOX, *rays, field.step)).color
    loss = (color - torch.from_numpy(batch.targets)).square().sum()
    by_values, by_around = torch.autograd.grad(loss, (values, around))
    assert abs(error * 3 * 200 / loss.item() - 1) < 1e-4
    assert relative(learner.inner.dense_gradient(), by_values) < 1e-3
    assert relative(learner.outer.dense_gradient(), by_around) < 1e-3


@pytest.mark.parametrize("make", [random_voxels, random_voxels_in_a_room])
def test_the_torch_learner_has_the_kernels_gradient_with_jitter_sparsity_and_empty_blocks(make):
    field = make()
    field.values[:12, :, :, 0] = EMPTY_RAW
    compiled = GridLearner.of(field, 1.7, workers=2)
    plain, batch = TorchLearner.of(compiled, CPU), batch_of(200, jitter=1.0)
    error = compiled.gradient(batch, 1e-3)
    plain_error, gradients = plain.gradient(batch, 1e-3)
    assert abs(error / plain_error - 1) < 1e-4
    for grid, gradient in zip((compiled.inner, compiled.outer), gradients, strict=False):
        assert relative(grid.dense_gradient(), gradient) < 1e-3


def points_of(count: int, seed: int = 5) -> PointBatch:
    batch = batch_of(count, seed, jitter=1.0)
    distances = 4 * torch.rand(count, generator=torch.Generator().manual_seed(seed)).numpy()
    return PointBatch(batch.origins, batch.directions, distances, batch.jitter)


@pytest.mark.parametrize("make", [random_voxels, random_voxels_in_a_room])
def test_the_learners_agree_on_what_rays_to_points_tell(make):
    field = make()
    field.values[:12, :, :, 0] = EMPTY_RAW
    compiled, batch = GridLearner.of(field, 1.0, workers=2), points_of(300)
    compiled.add_points(batch, 0.7)
    wanted = 0.7 * TorchLearner.of(compiled, CPU).points_gradient(batch)
    assert (wanted[..., 0] > 0).any() and (wanted[..., 0] < 0).any() and not wanted[..., 1:].any()
    assert relative(compiled.inner.dense_gradient(), wanted) < 1e-3


def test_a_step_with_points_is_the_same_for_both_learners():
    compiled = GridLearner.of(random_voxels_in_a_room(), 1.0, workers=2)
    plain, rates = TorchLearner.of(compiled, CPU), replace(RATES, points=0.5)
    for learner in (compiled, plain):
        learner.step(batch_of(300, jitter=1.0), rates, points_of(300))
    difference = (torch.from_numpy(compiled.inner.values) - plain.inner.values).abs()
    assert (difference < 1e-3).float().mean() > 0.995
    without = GridLearner.of(random_voxels_in_a_room(), 1.0, workers=2)
    without.step(batch_of(300, jitter=1.0), rates)
    assert not np.array_equal(without.inner.values, compiled.inner.values)


def test_a_few_steps_lead_the_torch_learner_where_the_kernels_lead():
    compiled = GridLearner.of(random_voxels_in_a_room(), 1.0, workers=2)
    plain = TorchLearner.of(compiled, CPU)
    for seed in range(3):
        batch = batch_of(300, seed, jitter=1.0)
        assert abs(compiled.step(batch, RATES) / plain.step(batch, RATES) - 1) < 1e-3
    pairs = ((compiled.inner, plain.inner), (compiled.outer, plain.outer))
    for ours, theirs in pairs:
        assert theirs is not None
        difference = (torch.from_numpy(ours.values) - theirs.values).abs()
        # Adam's first steps have the size of the rate whatever the gradient: a rounded zero may go either way
        assert (difference < 1e-3).float().mean() > 0.995
    empty = [learner.field(Finish()).values[..., 0] == EMPTY_RAW for learner in (compiled, plain)]
    assert torch.equal(*empty)


def test_what_is_looked_at_is_told_in_parts_of_two_cells_as_torch_has_it():
    field = random_voxels()
    field.values[::2, 3:, 1:7, 0] = EMPTY_RAW
    learner = GridLearner.of(field, 1.0, workers=1)
    learner.inner.slots[0] = -1
    threshold = float(field.values[..., 0].quantile(0.97))
    parts_above(learner.inner.values, learner.inner.slots, np.float32(threshold), learner.occupied)
    bits = np.unpackbits(learner.occupied[..., None], axis=-1, bitorder="little")
    x, y, z = learner.occupied.shape
    found = bits.reshape(x, y, z, 2, 2, 2).transpose(0, 3, 1, 4, 2, 5).reshape(2 * x, 2 * y, 2 * z) > 0
    wanted = occupied_blocks(field.values[..., 0], threshold, 1)
    wanted[:2] = False
    nx, ny, nz = wanted.shape
    assert 0.1 < wanted.float().mean() < 0.9
    assert torch.equal(torch.from_numpy(found[:nx, :ny, :nz]), wanted)
    assert found.sum() == wanted.sum()


def test_the_learners_agree_where_parts_are_empty_and_light_runs_out():
    field = random_voxels()
    field.values[4:, ::3, :, 0] = EMPTY_RAW
    field.values[14:16, :, :, 0] = 1.5
    compiled = GridLearner.of(field, 1.0, workers=1)
    plain, batch = TorchLearner.of(compiled, CPU), batch_of(300, jitter=1.0)
    compiled.prune_empty_blocks()
    plain.prune_empty_blocks()
    assert abs(compiled.gradient(batch, 1e-3) / (wanted := plain.gradient(batch, 1e-3))[0] - 1) < 1e-4
    assert relative(compiled.inner.dense_gradient(), wanted[1][0]) < 1e-3


def test_only_blocks_that_are_looked_at_take_memory():
    values = torch.full((33, 33, 33, 4), EMPTY_RAW)
    values[16:18, 16:18, 16:18, 0] = 0.0
    learner = GridLearner.of(VoxelField(BOX, values, torch.zeros(3)), 1.0, workers=2)
    assert learner.inner.gradients.shape[1] <= 27
    full = TrainedGrid(values, values[..., 0], 2)
    arrays = (full.values, full.rate_scale, full.gradients, full._moments)
    assert sum(array.nbytes for array in arrays) < 1.4 * training_bytes(33**3, 2)  # blocks reach over the border


def test_a_refined_grid_shows_what_the_coarse_one_showed():
    field = random_voxels()
    learner = GridLearner.of(field, 1.0, workers=2)
    fine = learner.refined((41, 45, 25))
    raw = torch.from_numpy(fine.inner.values[..., 0])
    assert raw.shape == (41, 45, 25)
    torch.testing.assert_close(raw[::2, ::2, ::2], field.values[..., 0], rtol=1e-5, atol=1e-5)
    plain = TorchLearner.of(learner, CPU).refined((41, 45, 25))
    torch.testing.assert_close(plain.inner.values[..., 0], raw)


def test_a_field_on_another_device_is_the_same_field():
    field = random_voxels_in_a_room()
    moved = replace(field, evidence=torch.zeros(field.shape, dtype=torch.uint8)).to("cpu")
    assert moved.outside is not None and moved.evidence is not None
    rays = random_rays(50)
    assert torch.equal(moved.render_rays(*rays).color, field.render_rays(*rays).color)


def test_finishing_empties_fog_and_firms_surfaces_by_the_factor():
    values = torch.full((9, 9, 9, 4), EMPTY_RAW)
    values[2, 2, 2, 0], values[6, 6, 6, 0] = -8.0, -3.0  # 0.13 / m and 19 / m
    learner = GridLearner.of(VoxelField(BOX, values, torch.zeros(3)), 1.0, workers=1)
    finished = learner.field(Finish(empty_below=0.5, firm_above=3.0, firmness=2.0))
    assert finished.values[2, 2, 2, 0] == EMPTY_RAW
    at = BOX.lower + torch.tensor([[6.0, 6.0, 6.0]]) * finished.spacing
    before = VoxelField(BOX, values, torch.zeros(3)).density(at)
    assert 1.9 < (finished.density(at) / before).item() < 2.0
