"""Crossing: the box meets the planned way, unaware flights are hit, and announced ones go clear."""

from functools import partial

import numpy as np
import pytest

import nerfnav_scenes as scenes
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.closed_loop_flight import FlightTrial, make_problem
from nerfnav.experiments.moving import crossing
from nerfnav.experiments.moving.crossing import KNOWS, PACES, Crossing, draw_box, draw_figure, fly, summarize, trials_of
from nerfnav.experiments.study import Row, Study
from nerfnav.field import load_field
from nerfnav.world import Task
from tests.experiments.places import TASKS, column

ALONG = TASKS[1]


def trial(knows: str, pace: float, seed: int = 0) -> Crossing:
    return Crossing(ALONG, seed, knows, pace)


def test_the_box_is_on_the_planned_way_when_the_plan_is_there() -> None:
    problem = make_problem(column(), ALONG, FlightTrial(ALONG, 0))
    plan = crossing._plan_of(column(), ALONG)
    speed = plan.states.position.diff(dim=0).norm(dim=-1).sum().item() / (problem.steps * problem.dt)
    for seed in range(5):
        boxes = [draw_box(column(), problem, trial("announced", pace, seed)) for pace in PACES]
        for pace, box in zip(PACES, boxes, strict=True):
            gaps = box.least_gaps(plan.states, plan.dt, problem.robot.body, 0.0)
            assert gaps.min() < 0 and gaps[0] > 0
            assert box.speed_bound == pytest.approx(pace * speed, rel=1e-6)
            assert box.obstacles[0].shape.support(np.eye(3)) == pytest.approx(1.25 * max(problem.robot.body.extents))
        again = draw_box(column(), problem, trial("unaware", PACES[0], seed))
        assert again.obstacles == boxes[0].obstacles, "it is the same whatever the robot knows"


def test_each_trial_is_flown_with_the_same_seed_whatever_the_robot_knows() -> None:
    found = trials_of(Study(column, TASKS, trials=3, seed=7))
    assert len(found) == 3 * (2 + 5 * len(PACES)) and {each.seed for each in found} == {7, 8, 9}
    assert {(each.knows, each.pace) for each in found if each.seed == 7} == {
        ("alone", 0.0), ("watching", 0.0), *((knows, pace) for knows in KNOWS[2:] for pace in PACES),
    }  # fmt: skip
    drive = Task("drive", (0.0, 0.0, 0.1), (0.5, 0.0, 0.1), robot="diffdrive")
    with pytest.raises(InvalidInputError, match="no task of a quadrotor"):
        trials_of(Study(column, (drive,)))


@pytest.mark.slow
def test_an_unaware_robot_is_hit_and_one_that_knows_arrives() -> None:
    arena = Arena(scenes.load("stonehenge"), load_field(scenes.trained_path("stonehenge")))
    task = trials_of(Study(lambda: arena, arena.scene.tasks, trials=1))[0].task
    rows = [fly(arena, Crossing(task, 0, knows, 0.6)) for knows in ("unaware", "announced")]
    assert [(row["hit"], row["clean"]) for row in rows] == [(True, False), (False, True)]
    assert rows[0]["outcome"] == "collided" and rows[1]["least_distance_m"] > 0.02


@pytest.mark.slow
def test_a_robot_that_watches_keeps_clear_of_a_box_of_which_it_was_not_told() -> None:
    arena = Arena(scenes.load("stonehenge"), load_field(scenes.trained_path("stonehenge")))
    task = trials_of(Study(lambda: arena, arena.scene.tasks, trials=15))[-1].task
    rows = [fly(arena, Crossing(task, 14, knows, pace)) for knows, pace in (("unaware", 0.3), ("seen", 0.3))]
    assert [(row["hit"], row["clean"]) for row in rows] == [(True, False), (False, True)]
    assert rows[1]["in_view"] and rows[1]["seen_steps"] > 2 and rows[1]["least_distance_m"] > 0.02


def fake(_: Arena, flown: Crossing) -> Row:
    hit = flown.knows == "unaware"
    return {
        "task": flown.task.name, "seed": flown.seed, "knows": flown.knows, "pace": flown.pace,
        "outcome": "collided" if hit else "reached", "clean": not hit, "hit": hit, "touches": int(hit), "steps": 20,
        "lost": False, "position_median_m": 0.002 if flown.pace else 0.001, "position_p95_m": 0.004,
        "in_view": flown.seed % 2 == 0 if flown.pace else None, "seen_steps": 3, "first_seen_s": 0.4, "answer_s": None,
        "nees_pose_mean": 5.0, "least_distance_m": None, "replan_p50_ms": 20.0, "replan_p95_ms": 40.0,
    }  # fmt: skip


def test_the_summary_counts_by_knowledge_and_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crossing, "fly", fake)
    study = Study(column, TASKS, trials=2)
    results = run_steps(crossing.run(Study(column, TASKS, trials=2, beside=(study,))))
    assert len(results.rows) == 2 * 2 * 17 and results.rows[0]["place"] == "column"
    found = summarize(results.rows)
    assert found["unaware"]["pace_0.3"]["hit"] == 4 and found["announced"]["pace_1"]["clean"] == 4
    assert found["announced"]["pace_0.6"]["error_ratio"] == 2.0 and found["alone"]["trials"] == 4
    assert {found[f"seen_{view}"]["pace_1"]["trials"] for view in ("in_view", "outside")} == {2}
    assert found["seen_in_view"]["pace_1"]["seen_steps"] == 6 and found["watching"]["trials"] == 4
    assert results.summary["together"] == found
    assert len(partial(draw_figure, results.rows)().axes) == 2
