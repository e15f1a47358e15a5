"""How planning is compared: on small numbers of iterations, in a bundled scene."""

import os

import pytest
import torch

import nerfnav_scenes as scenes
from nerfnav.experiments.arena import Arena
from nerfnav.field.storage.checkpoint import load_field
from nerfnav_app.benchmarks import busy, cold, plan, replan, scaling


@pytest.fixture(scope="module")
def arena() -> Arena:
    return Arena(scenes.load("stonehenge"), load_field(scenes.trained_path("stonehenge")))


@pytest.mark.slow
def test_the_fast_plan_is_no_dearer_and_both_are_timed(arena: Arena):
    before = torch.get_num_threads()
    found = plan.measure(arena, tasks=1, fast_per_round=2, iterations=30)
    assert found.name == "plan" and found.threads >= 1
    assert found.ratio == found.paper_ms / found.fast_ms > 0
    assert found.detail["max_j_ratio"] == found.detail["task_0_j_ratio"] < 1.02
    assert torch.get_num_threads() == before


@pytest.mark.slow
def test_a_plan_is_redone_at_no_higher_cost_and_the_way_to_the_same_cost_is_timed(arena: Arena):
    found = replan.measure(arena, tasks=2, rounds=1, fast_per_round=2, iterations=60)
    assert found.ratio == found.paper_ms / found.fast_ms > 0
    assert found.detail["same_j_ratio"] > 0 and found.detail["same_j_ms"] > 0
    assert found.detail["max_j_ratio"] < 1.05


@pytest.mark.slow
def test_iterations_of_all_sizes_and_plans_from_one_and_many_starts_are_timed(arena: Arena):
    found = scaling.measure(arena, repeats=5, tasks=1)
    assert found.waypoints.shape == found.body_points.shape == found.iteration_ms.shape
    assert (found.iteration_ms > 0).all() and 0 <= found.linearity <= 1
    assert len(set(zip(found.waypoints, found.body_points, strict=True))) == len(found.iteration_ms) == 16
    assert found.starts == 8 and found.one_start_ms > 0 and found.all_starts_ms > 0
    assert len(scaling.picture(found).axes) == 2


@pytest.mark.slow
def test_all_parts_of_the_loop_are_timed_alone_and_beside_busy_processes(arena: Arena):
    before = os.sched_getaffinity(0)
    found = busy.measure(arena, tasks=1, rounds=1, per_round=1)
    assert set(found) == {"plan", "replan", "filter"}
    for row in found.values():
        assert row["ratio"] == row["busy_ms"] / row["quiet_ms"] > 0
    assert os.sched_getaffinity(0) == before


@pytest.mark.slow
def test_the_first_plan_of_a_new_process_is_timed_apart_from_what_comes_before_it():
    found = cold.measure("stonehenge", rounds=1)
    assert set(found) == {"import_s", "open_s", "first_plan_s", "first_plan_cpu_s"}
    assert all(seconds > 0 for seconds in found.values())
