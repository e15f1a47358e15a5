"""How rendering and training are compared: few rays, in a bundled scene."""

import pytest
import torch

import nerfnav_scenes as scenes
from nerfnav.experiments.arena import Arena
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.checkpoint import load_field
from nerfnav_app.benchmarks import render, train_step


@pytest.fixture(scope="module")
def arena() -> Arena:
    field = load_field(scenes.trained_path("stonehenge"))
    assert isinstance(field, VoxelField)
    return Arena(scenes.load("stonehenge"), field)


def test_pictures_are_rendered_alike_and_both_ways_are_timed(arena: Arena):
    before = torch.get_num_threads()
    found = render.measure(arena, pictures=1, size=24, fast_per_round=3)
    assert found.name == "render" and found.threads >= 1
    assert found.ratio == found.paper_ms / found.fast_ms > 0
    assert found.detail["max_color_difference"] < 1e-4
    assert torch.get_num_threads() == before


@pytest.mark.slow
def test_a_training_step_has_the_same_gradient_and_both_ways_are_timed(arena: Arena):
    found = train_step.measure(arena, rays=128, rounds=1, fast_per_round=3)
    assert found.ratio == found.paper_ms / found.fast_ms > 0
    assert found.detail["max_gradient_difference"] < 1e-3
    assert found.detail["error_difference"] < 1e-4
