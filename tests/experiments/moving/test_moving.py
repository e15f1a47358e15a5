"""Corridors full of moving boxes: the worlds, the judge, and the flights of each planner."""

import importlib.util
import json
import os
from pathlib import Path

import numpy as np
import pytest

from nerfnav.core.errors import UnknownNameError
from nerfnav.core.steps import run_steps
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.moving import contenders, experiment, snapshot
from nerfnav.experiments.moving.contenders import CONTENDERS, fly_in_snapshots
from nerfnav.experiments.moving.experiment import Corridor, fly, run, summarize
from nerfnav.experiments.moving.judge import Flown, judge_flight
from nerfnav.experiments.moving.snapshot import RRTInSnapshot, Snapshot, SnapshotFlight
from nerfnav.experiments.moving.worlds import GOAL, START, World, make_world
from nerfnav.experiments.study import Study
from nerfnav.obstacles import BoxShape, Obstacle, ObstacleSet
from nerfnav.planner.moving.search import plan_among
from tests.experiments.places import column

MOVING = Path(os.environ.get("NERFNAV_TEST_DATA", ".")) / "moving"
with_samples = pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="NERFNAV_TEST_DATA is not set")


@with_samples
@pytest.mark.parametrize("level", ["easy", "medium", "hard"])
def test_worlds_are_those_of_the_samples(level: str) -> None:
    sample = json.loads((MOVING / f"{level}_00.json").read_text())
    world = make_world(level, 0)
    movers = [obstacle for obstacle in world.obstacles.obstacles if obstacle.moves]
    statics = [obstacle for obstacle in world.obstacles.obstacles if not obstacle.moves]
    assert (len(movers), len(statics)) == (len(sample["moving"]), len(sample["static"]))
    assert (list(START), list(GOAL)) == (sample["start"], sample["goal"])
    boxes = world.obstacles.boxes([0.0])
    for index, (mover, wanted) in enumerate(zip(movers, sample["moving"], strict=True)):
        trefoil = wanted["trefoil"]
        assert mover.position == tuple(trefoil["origin"]) and boxes.halves[index].tolist() == wanted["half_extents"]
        motion = mover.motion
        assert (motion.scale, motion.phase, motion.slower) == (
            tuple(trefoil["scale"]), trefoil["offset"], trefoil["slower"]
        )  # fmt: skip
    for static, wanted in zip(statics, sample["static"], strict=True):
        assert static.position == tuple(wanted["center"])
        assert static.span(np.eye(3))[1].tolist() == wanted["half_extents"]
    there = movers[0].place(np.array([sample["check"]["t"]]))[0]
    np.testing.assert_allclose(there, sample["check"]["first_mover"], atol=1e-12)


@with_samples
def test_the_judge_agrees_with_that_of_the_samples() -> None:
    spec = importlib.util.spec_from_file_location("make_worlds", MOVING / "make_worlds.py")
    assert spec is not None and spec.loader is not None
    reference = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(reference)
    for seed in range(3):
        world, there = make_world("easy", seed), reference.make_world("easy", seed)
        times = np.arange(2101) / 100
        flown = flown_straight(times)
        row = judge_flight(world, flown)
        for name, rule in (("touched_boxes", "boxes"), ("touched_cubes", "sando")):
            assert row[name] == reference.judge(there, times, flown.states[0], rule)["collided"]
        assert row["least_distance_m"] == pytest.approx(reference.judge(there, times, flown.states[0])["clearance"])


def flown_straight(times: np.ndarray) -> Flown:
    states = np.zeros((4, len(times), 3))
    states[0] = START
    states[0, :, 0] = 5 * times
    states[1, :-1, 0] = 5
    return Flown(times, states)


def empty(*obstacles: Obstacle) -> World:
    return World("easy", 0, ObstacleSet(obstacles))


def test_the_judge_measures_a_straight_flight_and_each_way_to_fail() -> None:
    times = np.arange(2101) / 100
    row = judge_flight(empty(), flown_straight(times))
    assert row["success"] and row["time_s"] == 21 and row["path_m"] == pytest.approx(105)
    assert row["jerk_mps2"] == 0 and row["violations_percent"] == 0 and row["largest_y_m"] == 0
    pillar = Obstacle("pillar", BoxShape((0.4, 0.4, 4.0)), (50.0, 0.35, 2.0))
    row = judge_flight(empty(pillar), flown_straight(times))
    assert not row["success"] and row["touched_cubes"] and not row["touched_boxes"]
    assert row["least_distance_m"] == pytest.approx(0.05)
    bar = Obstacle("bar", BoxShape((0.4, 4.0, 0.4)), (50.0, 2.05, 2.0))
    row = judge_flight(empty(bar), flown_straight(times))
    assert not row["success"] and row["touched_boxes"] and not row["touched_cubes"]
    outside, fast, short = (flown_straight(times) for _ in range(3))
    outside.states[0, 500:600, 1] = 6.01
    fast.states[3, 100:121, 2] = 100.01
    short.states[0, :, 0] -= 1.0
    assert not judge_flight(empty(), outside)["success"]
    assert judge_flight(empty(), fast)["violations_percent"] == pytest.approx(100 * 21 / 2101)
    row = judge_flight(empty(), short)
    assert not row["success"] and not row["arrived"]
    assert not judge_flight(empty(), Flown(times, outside.states * np.nan))["success"]


def test_announced_flights_arrive_within_the_limits_and_no_level_is_unknown() -> None:
    for name, level in (("announced", "easy"), ("announced_once", "hard")):
        row = fly(column(), Corridor(name, level, 1))
        assert row["success"] and row["violations_percent"] == 0 and row["time_s"] < 24.2 and row["largest_y_m"] <= 6
        assert row["least_distance_m"] > 0 and row["first_plan_ms"] > 0
        assert (row["replan_p50_ms"] is None) == (name == "announced_once")
    with pytest.raises(UnknownNameError, match="level"):
        make_world("harder", 0)


@pytest.mark.slow
@pytest.mark.parametrize("level", ["easy", "medium", "hard"])
def test_first_plans_clear_both_rules_in_many_worlds(level: str) -> None:
    for seed in range(100, 106):
        world = make_world(level, seed)
        plan = plan_among(world.problem())
        assert plan is not None and judge_flight(world, Flown.of(plan))["success"]


def test_rrt_flies_around_what_stands_and_keeps_the_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("ompl")
    monkeypatch.setattr("nerfnav.experiments.moving.worlds.GOAL", (8.0, 0.0, 2.0))
    world = empty(Obstacle("pillar", BoxShape((0.4, 0.4, 4.0)), (4.0, 0.1, 2.0)))
    flight = SnapshotFlight(world.problem(), RRTInSnapshot(), 0)
    plan = flight.fly()
    assert plan.keeps(world.problem().limits) and len(flight.replan_ms) > 20
    times = np.arange(0, plan.duration, 0.01)
    path = plan.derivative(times)
    assert np.linalg.norm(path[-1] - [8.0, 0.0, 2.0]) < 0.3 and np.abs(path[:, 1]).max() < 3
    boxes = world.obstacles.boxes(times)
    assert not (np.abs(path[:, None] - boxes.centers) <= boxes.halves + 0.1).all(-1).any()


class NoPath:
    """Planner that never finds a path."""

    def find_path(self, *_: object) -> None:
        return None


def test_a_flight_without_a_path_stays_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(snapshot, "LONGEST_S", 2.0)
    flight = fly_in_snapshots(NoPath(), make_world("easy", 0))
    assert flight.plan is not None and np.ptp(flight.plan.points) == 2.0
    row = judge_flight(make_world("easy", 0), Flown.of(flight.plan))
    assert not row["success"] and not row["arrived"] and not row["touched_boxes"]


def test_points_on_boxes_are_on_the_true_surface() -> None:
    found = contenders._surface_points(
        Snapshot(np.array([[1.0, 2.0, 3.0]]), np.array([[0.5, 0.5, 2.1]]), np.zeros(3), np.ones(3))
    )
    off = np.abs(found - [1.0, 2.0, 3.0])
    assert off.max(0).tolist() == pytest.approx([0.4, 0.4, 2.0])
    assert (np.abs(off - [0.4, 0.4, 2.0]) < 1e-9).any(1).all() and len(found) > 200


def test_the_summary_has_each_level_and_names_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def instant(_: Arena, trial: Corridor) -> dict:
        judged = judge_flight(empty(), flown_straight(np.arange(2101) / 100))
        return {"planner": trial.planner, "level": trial.level, "seed": trial.seed} | judged | {
            "success": trial.seed != 7, "first_plan_ms": 3.0, "replan_p50_ms": 1.0, "replan_p95_ms": float(trial.seed),
        }  # fmt: skip

    monkeypatch.setattr(experiment, "fly", instant)
    monkeypatch.setattr(contenders, "explain_missing", lambda *_: None)
    results = run_steps(run(Study(column, trials=3, seed=6)))
    methods = results.summary["methods"]
    assert list(methods) == list(CONTENDERS)
    hard = methods["announced"]["hard"]
    assert (hard["worlds"], hard["successes"], hard["replan_p95_ms"]) == (3, 2, 8.0) and hard["time_median_s"] == 21
    assert [row["seed"] for row in results.rows[:3]] == [6, 7, 8] and results.rows[0]["level"] == "easy"
    skipped = summarize(results.rows, {"rrt": "not installed"})["methods"]["rrt"]
    assert skipped == {"skipped": "not installed"}
