"""Obstacles of a file in a place: plans go around them, and impossible ones are one sentence."""

import json
from pathlib import Path

import numpy as np
import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.planner import PlanOutcome
from nerfnav_app.cli.commands.fly import make_request
from nerfnav_app.cli.main import main, parse
from nerfnav_app.jobs.fly.command import command_of
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.fly.setup import begin
from nerfnav_app.jobs.fly.simulated_world import camera_of_movers, hidden_by_movers
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.obstacles import open_with_obstacles, require_clear_ends, require_standing
from tests.app.doubles import balls_place

ENDS = Ends(End((-0.8, 0.6, 0.4)), End((0.8, 0.6, 0.4)))


def obstacles_in(folder: Path, text: str) -> Path:
    path = folder / "obstacles.yaml"
    path.write_text(f"obstacles: [{text}]")
    return path


def test_a_plan_goes_around_an_obstacle_on_its_way(tmp_path: Path) -> None:
    from nerfnav_app.jobs.plan import plan as job
    from tests.app.following import result_of

    place = balls_place()
    path = obstacles_in(tmp_path, "{name: post, cylinder: {radius: 0.1, height: 1}, position: [0, 0.6, 0.4]}")
    placed = open_with_obstacles(place, path)
    assert placed.obstacles is not None and place.obstacles is None
    for where, touches in ((place, True), (placed, False)):
        request = PlanRequest(ENDS, steps=30, out=tmp_path / str(touches))
        summary = result_of(job.run(request, where)).summary
        assert summary["outcome"] == PlanOutcome.CONVERGED.name.lower()
        rows = json.loads((tmp_path / str(touches) / "trajectory.json").read_text())
        states = np.array(rows["position"] if "position" in rows else [row[1:4] for row in rows["rows"]])
        assert (placed.obstacles.signed_distance(states).min() < 0) == touches


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{name: a, box: [0.2, 0.2, 0.2], position: [-0.8, 0.6, 0.4]}", "the obstacle 'a' stands on the start"),
        ("{name: a, sphere: 0.002, position: [0.804, 0.603, 0.403]}", "the obstacle 'a' stands on the goal"),
        ("{name: a, box: [1, 1, 0.8], position: [-0.7, 0.5, 0.4]}", "the obstacle 'a' stands on the start"),
        ("{name: a, sphere: 0.1, position: [9, 0, 0]}", "yaml: the obstacle 'a' at .* lies outside the place"),
        ("{name: a, sphere: 0.3, position: [-0.8, 0.5, 0.4], motion: {velocity: [1, 0, 0]}}", "'a' stands on the sta"),
        ("{name: a, cut_out: {sphere: 0.1, position: [-0.8, 0.6, 0.7]}}", "yaml: the volume of 'a' holds nothing"),
        ("{name: a, cut_out: {sphere: 0.1, position: [90, 0, 0]}}", "yaml: the volume of 'a' holds nothing"),
        ("{sphere: 0}", r"obstacles\[0\].sphere is 0"),
    ],
)
def test_impossible_obstacles_are_one_sentence(text: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=reason) as raised:
        place = open_with_obstacles(balls_place(), obstacles_in(tmp_path, text))
        assert place.obstacles is not None
        require_clear_ends(place.obstacles, place.robot, ENDS)
    assert "\n" not in str(raised.value)


def test_obstacles_that_move_stay_beside_the_field_and_may_stand_on_the_goal(tmp_path: Path) -> None:
    place = balls_place()
    mover = "{name: a, sphere: 0.1, position: [0.8, 0.6, 0.4], motion: {velocity: [1, 0, 0]}}"
    path = obstacles_in(tmp_path, mover)
    placed = open_with_obstacles(place, path)
    assert placed.field is place.field and placed.movers is not None and placed.obstacles is not None
    assert [obstacle.name for obstacle in placed.movers.obstacles] == ["a"] and place.movers is None
    require_clear_ends(placed.obstacles, placed.robot, ENDS)
    with pytest.raises(InvalidInputError, match="yaml: the obstacle 'a' moves, and here obstacles stand"):
        require_standing(path)
    stands = ", {name: b, sphere: 0.1, position: [0, 0.6, 0.4]}"
    both = open_with_obstacles(place, obstacles_in(tmp_path, mover + stands))
    assert both.field is not place.field and both.movers is not None and len(both.movers.obstacles) == 1
    require_standing(obstacles_in(tmp_path, stands[2:]))


def test_a_robot_is_not_told_of_obstacles_that_are_seen(tmp_path: Path) -> None:
    place = balls_place()
    ball = "sphere: 0.1, position: [0, 0.6, 0.4]"
    path = obstacles_in(
        tmp_path, f"{{name: a, {ball}, seen: true}}, {{name: b, {ball}, motion: {{velocity: [1, 0, 0]}}}}"
    )
    placed = open_with_obstacles(place, path)
    assert placed.field is place.field and placed.movers is not None and placed.announced_movers is not None
    assert [len(each.obstacles) for each in (placed.movers, placed.announced_movers)] == [2, 1]
    alone = open_with_obstacles(place, obstacles_in(tmp_path, f"{{name: a, {ball}, seen: true}}"))
    assert alone.announced_movers is None and hidden_by_movers(alone) is None and camera_of_movers(alone) is not None
    with pytest.raises(
        InvalidInputError, match="yaml: the obstacle 'a' is not announced, and here obstacles stand"
    ):
        require_standing(obstacles_in(tmp_path, f"{{name: a, {ball}, seen: true}}"))


def test_a_flight_watches_where_it_is_asked_to_and_where_an_obstacle_is_seen(tmp_path: Path) -> None:
    words = ["fly", "stonehenge", "--start", "-0.8", "0.6", "0.4", "--goal", "0.8", "0.6", "0.4"]
    path = obstacles_in(tmp_path, "{name: a, sphere: 0.1, position: [0, -0.6, 0.4], seen: true}")
    seen = open_with_obstacles(balls_place(), path)
    for place, more, watches in ((balls_place(), [], False), (balls_place(), ["--watch"], True), (seen, [], True)):
        request = make_request(parse([*words, *more])[1], place)
        assert request.route.watch is watches
        assert ("--watch" in command_of(request, place, 20, 0.1)) is watches
    for options in ({"planner": "rrt"}, {"world": "physical"}):
        request = FlyRequest(PlanRequest(ENDS, watch=True, steps=30, **options))
        with pytest.raises(InvalidInputError, match="leave --watch"):
            run_steps(begin(request, None, balls_place()))


def test_a_flight_lets_a_mover_pass_and_is_judged_by_where_it_is(tmp_path: Path) -> None:
    from nerfnav_app.jobs.fly import fly as job
    from nerfnav_app.storage.kept_obstacles import KEPT
    from tests.app.following import result_of

    path = obstacles_in(
        tmp_path, "{name: a, box: [0.3, 0.3, 0.3], position: [0, -0.4, 0.4], motion: {velocity: [0, 0.67, 0]}}"
    )
    placed = open_with_obstacles(balls_place(), path)
    assert placed.movers is not None
    request = FlyRequest(PlanRequest(ENDS, steps=30), obstacles=path, open_loop=True, out=tmp_path / "fly")
    result = result_of(job.run(request, placed))
    assert tmp_path / "fly" / KEPT in result.files and result.summary["obstacles"] == 1
    rows = json.loads((tmp_path / "fly" / "steps.jsonl").read_text().splitlines()[0])
    plan = np.array(rows["plan"]["states"]).reshape(-1, 18)[:, :3]
    times = 0.1 * np.arange(len(plan))
    assert placed.movers.boxes(times, placed.robot.body).gaps(plan).min() > 0
    with pytest.raises(InvalidInputError, match="'rrt' knows no obstacles that move: take the planner 'fast'"):
        result_of(job.run(FlyRequest(PlanRequest(ENDS, planner="rrt", steps=30)), placed))


def test_the_command_refuses_a_file_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "stonehenge", "--obstacles", str(tmp_path / "none.yaml")]) == 2
    assert "there is no file" in capsys.readouterr().err


def test_a_flight_records_its_obstacles_in_its_command() -> None:
    request = FlyRequest(PlanRequest(ENDS), obstacles=Path("crates.yaml"))
    assert "--obstacles crates.yaml" in command_of(request, balls_place(), 20, 0.1)
