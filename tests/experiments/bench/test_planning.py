"""How planning is compared: on small numbers of iterations, in a bundled scene."""

import pytest
import torch

import scenes
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.bench import plan, replan, scaling
from nerfnav.field.checkpoint import load_field


@pytest.fixture(scope="module")
def arena() -> Arena:
    return Arena(scenes.load("stonehenge"), load_field(scenes.trained_path("stonehenge")))


def test_the_fast_plan_is_far_sooner_done_and_no_dearer(arena: Arena):
    before = torch.get_num_threads()
    found = plan.measure(arena, tasks=1, fast_per_round=2, iterations=100)
    assert found.name == "plan" and found.threads >= 1
    assert found.ratio > 2
    assert found.detail["max_j_ratio"] == found.detail["task_0_j_ratio"] < 1.02
    assert torch.get_num_threads() == before


def test_a_plan_is_redone_sooner_and_to_the_same_cost_sooner_still(arena: Arena):
    found = replan.measure(arena, tasks=2, rounds=1, fast_per_round=2, iterations=60)
    assert found.ratio > 2
    assert 0 < found.detail["same_j_ms"] <= 1.5 * found.fast_ms
    assert found.detail["max_j_ratio"] < 1.05


def test_the_cost_of_an_iteration_grows_in_proportion_to_waypoints_and_body_points(arena: Arena):
    found = scaling.measure(arena, repeats=5, tasks=1)
    assert found.waypoints.shape == found.body_points.shape == found.iteration_ms.shape
    assert found.linearity > 0.8
    assert found.starts == 8
    assert found.all_starts_ms < 4 * found.one_start_ms
    assert len(scaling.picture(found).axes) == 2
