"""The comparison of planners in a place so simple that all of them must manage."""

from dataclasses import replace

import pytest

from nerfnav.core.steps import run_steps
from nerfnav.experiments.planners import PLANNERS, Flight, fly, run, summarize
from nerfnav.experiments.study import Results, Study
from nerfnav.world.task import Task
from tests.experiments.places import TASKS, column


@pytest.fixture(scope="module")
def results() -> Results:
    return run_steps(run(Study(column, TASKS)))


def test_every_planner_flies_every_task_without_touching(results: Results) -> None:
    assert {(row["planner"], row["task"]) for row in results.rows} == {
        (planner, task.name) for planner in PLANNERS for task in TASKS
    }
    for row in results.rows:
        assert row["max_overlap_m3"] == 0 and not row["failed"], row


def test_nerfnav_spends_the_least_effort(results: Results) -> None:
    effort = {name: results.summary[name]["effort_mean"] for name in PLANNERS}
    assert effort["nerfnav"] == min(effort.values())
    assert effort["nerfnav"] >= 20, "hovering alone costs 1 in each of 20 steps"


def test_the_figure_has_a_bar_for_every_planner(results: Results) -> None:
    for axes in results.figures["planners"]().axes:
        assert len(axes.patches) == len(PLANNERS)


def test_a_goal_that_cannot_be_reached_counts_as_a_failure() -> None:
    arena = column()
    inside_walls = arena.field.values.clone()
    inside_walls[30:32, :, :, 0] = 1.0  # a wall across the whole box
    closed = replace(arena, field=replace(arena.field, values=inside_walls))
    rows = [fly(closed, Flight(name, TASKS[0], 1)) for name in ("nerfnav", "minsnap")]
    assert all(row["failed"] and row["outcome"] == "no_path" for row in rows)


def test_the_summary_counts_touches_and_means() -> None:
    row = {"planner": "", "failed": False, "touched": False, "collision": 1.0, "effort": 20.0, "plan_ms": 5.0}
    rows = [row | {"planner": name} for name in PLANNERS]
    rows += [row | {"planner": "rrt", "failed": True, "touched": True, "collision": 3.0}]
    summary = summarize(rows)
    assert summary["rrt"]["flights"] == 2 and summary["rrt"]["failures"] == 1
    assert summary["rrt"]["collision_mean"] == 2.0
    assert summary["nerfnav"]["touched"] == 0


def test_the_same_seed_gives_the_same_tree() -> None:
    task = Task("Across", (-0.7, 0.05, 0.5), (0.7, 0.0, 0.5))
    one, same, other = (fly(column(), Flight("rrt", task, seed)) for seed in (2, 2, 3))
    assert one["effort"] == same["effort"]
    assert one["effort"] != other["effort"]
