"""Couches and wheels in a room with a narrow door."""

from dataclasses import replace
from functools import cache

import pytest
import torch
import trimesh

from nerfnav.core.steps import run_steps
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.ground_robots import Drive, drive, outlines, run
from nerfnav.experiments.study import Study
from nerfnav.field.models.voxel import EMPTY_RAW, VoxelField
from nerfnav.world.scene import Scene
from nerfnav.world.task import Task
from tests.experiments.places import BOX

ACROSS = torch.pi / 2
GAP = Task("Through the door", (-0.35, 0.0, 0.2), (0.35, 0.0, 0.2), ACROSS, ACROSS, "couch")
ROLL = Task("Roll through", (-0.5, 0.0, 0.2), (0.5, 0.0, 0.2), 0.0, 0.0, "diffdrive")
FLIGHT = Task("Fly", (-0.7, 0.05, 0.5), (0.7, 0.0, 0.5))


@cache
def room() -> Arena:
    """A wall 10 cm thick across the box, as high as it, with a door 22 cm wide."""
    walls = tuple(
        trimesh.creation.box(extents=(0.1, 0.89, 1.0)).apply_translation((0, side * 0.555, 0.5)) for side in (-1, 1)
    )
    values = torch.full((101, 101, 21, 4), EMPTY_RAW)
    values[48:53, :, :, 0] = 1.0
    values[48:53, 45:56, :, 0] = EMPTY_RAW
    scene = Scene("room", "Room", walls[0], walls, BOX, (0.5, 0.6, 0.7), (GAP, ROLL, FLIGHT))
    return Arena(scene, VoxelField(BOX, values, torch.ones(3)))


@pytest.mark.slow
def test_a_couch_turns_through_the_door_and_one_that_may_not_turn_hits_the_wall() -> None:
    answers = [drive(room(), Drive(GAP, held)) for held in (False, True)]
    assert answers[0] is not None and answers[1] is not None
    (turning, way), (held, stiff) = answers[0], answers[1]
    assert turning["outcome"] == "converged" and turning["max_overlap_m3"] == 0
    assert turning["turned_rad"] > 2.0
    assert held["max_overlap_m3"] > 1e-4
    assert max(abs(yaw - ACROSS) for _, _, yaw in stiff) < 0.05
    assert len(way) == len(stiff) == 31


@pytest.mark.slow
def test_wheels_pass_the_door_both_ways_without_sliding() -> None:
    results = run_steps(run(Study(room, (ROLL, FLIGHT))))
    assert [row["robot"] for row in results.rows] == ["diffdrive"] * 2
    assert results.summary["wheel_drives"] == 2 and results.summary["wheel_touched"] == 0
    assert results.summary["wheel_lateral_speed_max_mps"] < 1e-6
    assert results.summary["goal_missed_max_m"] < 1e-4
    assert results.summary["gap_overlap_m3"] is None
    figure = results.figures["ground_robots"]()
    assert len(figure.axes) == 3


@pytest.mark.slow
def test_a_task_that_begins_and_ends_with_other_headings_is_not_tried_with_a_held_one() -> None:
    results = run_steps(run(Study(room, (replace(GAP, goal_yaw=0.0),))))
    assert len(results.rows) == 1 and results.summary["refused"] == 0


def test_a_drive_that_begins_in_the_wall_is_counted_as_refused() -> None:
    results = run_steps(run(Study(room, (replace(ROLL, start=(0.0, 0.5, 0.2)),))))
    assert not results.rows
    assert results.summary["refused"] == 2 and results.summary["wheel_drives"] == 0


def test_outlines_are_where_walls_are_cut() -> None:
    cut = outlines(room(), 0.2)
    assert cut.shape[1:] == (2, 2)
    assert abs(cut[..., 0]).max() == pytest.approx(0.05)
    assert outlines(room(), 5.0).shape == (0, 2, 2)
