"""Whole flights: which are flown, what is reported of each, and how they are summed up."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav.core.errors import InvalidInputError, UnknownNameError
from nerfnav.core.steps import run_steps
from nerfnav.experiments import closed_loop_flight
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.closed_loop import REFUSED, draw_figure, fly, run, summarize, trials_of, wilson
from nerfnav.experiments.closed_loop_flight import SPARE, FlightTrial, find_task, random_task
from nerfnav.experiments.flight_options import FlightOptions
from nerfnav.experiments.study import Study
from nerfnav.navigation import EpisodeOutcome, FlightRequest, FlightStep, NavigationStack, Simulator
from nerfnav.robots import Quadrotor, load
from nerfnav.world import Task, contact_check
from tests.experiments.places import TASKS, column
from tests.planner.grounds import hall

TRUTH = FlightOptions(truth=True)


def test_half_of_the_flights_are_the_tasks_in_turn_and_half_have_random_ends() -> None:
    trials = trials_of(Study(column, TASKS, trials=6, seed=40))
    assert [trial.task for trial in trials] == [TASKS[0], None, TASKS[1], None, TASKS[0], None]
    assert [trial.seed for trial in trials] == [40, 41, 42, 43, 44, 45]
    assert trials[:3] == trials_of(Study(column, TASKS, trials=3, seed=40)), "more trials go on where fewer end"


@pytest.mark.parametrize(("ends", "drawn"), [("tasks", False), ("random", True)])
def test_an_option_says_which_ends_are_flown(ends: str, drawn: bool) -> None:
    options = FlightOptions(ends, truth=True)  # type: ignore[arg-type] # pytest's parameters are strings
    trials = trials_of(Study(column, TASKS, trials=3, flights=options))
    assert [trial.known for trial in trials] == [False, True] * 3
    assert all((trial.task is None) == drawn for trial in trials)


def test_the_physical_world_leaves_out_tasks_of_other_robots() -> None:
    drive = Task("Drive", (-0.7, 0.0, 0.1), (0.7, 0.0, 0.1), robot="diffdrive")
    options = FlightOptions("tasks", world="physical")
    trials = trials_of(Study(column, (drive, TASKS[1]), trials=2, flights=options))
    assert [trial.task for trial in trials] == [TASKS[1]] * 2
    with pytest.raises(InvalidInputError, match="ask for random ends"):
        trials_of(Study(column, (drive,), trials=1, flights=options))


def test_a_robot_that_is_asked_for_flies_what_is_asked_of_its_kind() -> None:
    drive = Task("Drive", (-0.7, 0.0, 0.1), (0.7, 0.0, 0.1), robot="cart")
    study = Study(column, (drive, TASKS[1]), trials=4, flights=FlightOptions(robot="crazyflie"))
    trials = trials_of(study)
    assert [trial.task for trial in trials] == [TASKS[1], None] * 2
    assert {trial.robot for trial in trials} == {"crazyflie"}
    wheels = FlightOptions("tasks", robot="turtlebot3")
    assert [trial.task for trial in trials_of(replace(study, flights=wheels))] == [drive] * 4
    with pytest.raises(InvalidInputError, match="no turtlebot3 can be: fly its tasks"):
        trials_of(replace(study, flights=replace(wheels, ends="both")))
    with pytest.raises(UnknownNameError, match="crazyfly"):
        trials_of(replace(study, flights=FlightOptions(robot="crazyfly")))


@pytest.mark.slow
def test_a_robot_of_a_file_that_is_too_slow_for_a_tasks_time_takes_as_long_as_its_way_does(tmp_path: Path) -> None:
    file = tmp_path / "slow.yaml"
    file.write_text(
        "name: slow\nkind: quadrotor\nmass: 0.1\nbody: {box: [0.08, 0.08, 0.03]}\nlimits: {speed: 0.5}\n"
    )
    row = fly(column(), FlightTrial(TASKS[1], 1, known=True, robot=str(file)))["row"]
    assert (row["robot"], row["outcome"], row["touches"]) == ("slow", "reached", 0)
    assert row["planned_steps"] == 40, "1.4 m at 0.5 m/s, with 1.4 times as long to ease in and out"


def test_random_ends_leave_room_for_the_robot_that_flies() -> None:
    large = load("x500")
    touches = contact_check(column().scene, large.body.grown(SPARE))
    task = random_task(column(), 2, large)
    assert task.robot == "x500" and not any(touches(end, end) for end in (task.start_state, task.goal_state))


@pytest.mark.slow
def test_a_flight_in_the_physical_world_arrives_with_the_state_known() -> None:
    row = fly(column(), FlightTrial(TASKS[0], 1, known=True, world="physical"))["row"]
    assert row["outcome"] == "reached" and row["touches"] == 0
    assert row["planned_steps"] == 20, "at the pace of the paper"


def test_random_ends_are_free_with_room_to_spare_and_the_same_for_the_same_seed() -> None:
    body = Quadrotor().body.grown(SPARE)
    touches = contact_check(column().scene, body)
    tasks = [random_task(column(), seed) for seed in range(5)]
    for task in tasks:
        for state in (task.start_state, task.goal_state):
            assert column().field.box.contains(state.position) and not touches(state, state)
        assert (task.start_state.position - task.goal_state.position).norm() >= 0.5
    assert tasks == [random_task(column(), seed) for seed in range(5)]
    assert len({task.start for task in tasks}) == 5


@pytest.mark.slow
def test_equal_seeds_give_equal_flights_with_the_state_known() -> None:
    trials = [FlightTrial(TASKS[0], seed, known=True) for seed in (3, 3, 4)]
    one, same, other = (fly(column(), trial) for trial in trials)
    timeless = {name: value for name, value in one["row"].items() if not name.endswith("_ms")}
    assert timeless["outcome"] == "reached" and timeless["touches"] == 0
    assert timeless == {name: value for name, value in same["row"].items() if name in timeless}
    assert one["row"]["final_m"] != other["row"]["final_m"]
    assert one["row"]["position_p95_m"] == 0


def test_flights_by_camera_tell_what_was_measured_of_the_field_at_training(monkeypatch: pytest.MonkeyPatch) -> None:
    floor, stacks = tuple((1e-4 * torch.eye(6)).flatten().tolist()), []

    def listened(
        request: FlightRequest, simulator: Simulator, stack: NavigationStack, *rest: object
    ) -> Iterator[FlightStep]:
        stacks.append(stack)
        return iter(())

    monkeypatch.setattr(closed_loop_flight, "navigate", listened)
    place = column()
    place = replace(place, field=replace(place.field, info=replace(place.field.info, pose_floor=floor)))
    for known in (False, True):
        fly(place, FlightTrial(TASKS[0], 1, known=known))
    seen, told = stacks
    assert seen.map_error.numbers == floor and torch.equal(seen.map_error.mount.rotation, Quadrotor().mount.rotation)
    assert not told.map_error.numbers, "who is told the state compares no pictures"


def test_a_flight_that_the_field_refuses_is_reported_as_such() -> None:
    inside = Task("Into the column", (-0.7, 0.0, 0.5), (0.0, 0.0, 0.5))
    row = fly(column(), FlightTrial(inside, 0, known=True))["row"]
    assert row["outcome"] == "refused" and row["final_m"] is None and row["steps"] == 0


def test_wilsons_interval_is_that_of_the_books() -> None:
    assert wilson(8, 10) == pytest.approx((0.4902, 0.9433), abs=1e-3)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=1e-3)
    assert wilson(0, 0) == (0.0, 1.0)


def test_what_happened_always_or_never_is_between_its_bounds() -> None:
    for total in range(1, 300):
        assert wilson(total, total)[1] == 1.0 and wilson(0, total)[0] == 0.0


def flight(outcome: str, state: str = "camera", ends: str = "tasks") -> dict:
    row = {"outcome": outcome, "state": state, "ends": ends, "touches": int(outcome == "collided"), "silent": False}
    steps = {"position_m": [0.01, 0.03], "nees": [10.0, 14.0], "inside_95": [True, False]}
    steps |= {"filter_ms": [1.0, 2.0], "replan_ms": [3.0, 4.0], "step_ms": [4.0, 6.0]}
    return {"row": row | {"nees_mean": 12.0}, "steps": steps}


def test_the_summary_counts_flights_by_camera_and_tells_those_with_the_truth_apart() -> None:
    flights = [flight("reached"), flight("collided"), flight("reached", ends="random"), flight("reached", "known")]
    summary = summarize(flights)
    assert (summary["trials"], summary["reached"], summary["collided"], summary["touched"]) == (3, 2, 1, 1)
    assert summary["truth_reached"] == summary["truth"]["trials"] == 1
    assert summary["tasks"]["trials"] == 2 and summary["random"]["reached"] == 1
    assert summary["position_median_m"] == pytest.approx(0.02) and summary["nees_mean"] == 12
    assert summary["inside_95"] == 0.5 and summary["step_max_ms"] == 6
    assert summarize(flights[:3])["truth_reached"] is None
    assert len(draw_figure(flights).axes[0].patches) == 3


def test_the_counts_of_all_outcomes_sum_to_the_trials() -> None:
    outcomes = [o.name.lower() for o in EpisodeOutcome if o is not EpisodeOutcome.STOPPED] + [REFUSED]
    summary = summarize([flight(outcome) for outcome in outcomes])
    assert summary["outside"] == 1 and sum(summary[outcome] for outcome in outcomes) == summary["trials"]


def test_an_option_lets_flights_go_on_after_a_contact() -> None:
    study = Study(column, TASKS, trials=2, flights=FlightOptions("tasks"))
    assert not any(trial.fly_on for trial in trials_of(study))
    assert all(trial.fly_on for trial in trials_of(replace(study, flights=FlightOptions("tasks", fly_on=True))))


@pytest.mark.slow
def test_flights_by_camera_and_with_the_truth_fill_one_table() -> None:
    results = run_steps(run(Study(column, TASKS, trials=2, flights=TRUTH)))
    assert [(row["ends"], row["state"]) for row in results.rows] == [
        ("tasks", "camera"), ("tasks", "known"), ("random", "camera"), ("random", "known")
    ]  # fmt: skip
    assert len({tuple(row) for row in results.rows}) == 1
    assert results.summary["truth_reached"] == 2
    assert results.replays.keys() == {"tasks_camera", "tasks_known", "random_camera", "random_known"}
    recording = results.replays["random_known"].record()
    assert recording is not None and recording.title == "column, random 1"
    assert len(recording.steps) == results.rows[3]["steps"] + 1, "it is the flight of the table"


def test_a_task_of_another_robot_is_driven_on_the_floor_and_refused_above_a_hole() -> None:
    place = Arena(column().scene, hall())
    task = Task("drive", (-1.2, -0.5, 0.7), (-0.3, -0.4, 0.7))
    stands = find_task(place, FlightTrial(task, 1, robot="diffdrive"))
    assert stands.start[:2] == task.start[:2] and stands.start[2] == stands.goal[2]
    assert 0.1 < stands.start[2] - 0.5 * load("diffdrive").body.extents[2] < 0.18
    assert find_task(place, FlightTrial(task, 1, robot="quadrotor25")).start == task.start
    hole = FlightTrial(replace(task, goal=(0.55, -0.4, 0.7)), 1, robot="diffdrive")
    assert fly(place, hole)["row"]["outcome"] == REFUSED
