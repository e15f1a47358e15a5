"""Obstacles of a file in a place: plans go around them, and impossible ones are one sentence."""

import json
from pathlib import Path

import numpy as np
import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.planner import PlanOutcome
from nerfnav_app.cli.main import main
from nerfnav_app.jobs.fly.command import command_of
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.obstacles import open_with_obstacles, require_clear_ends
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
        ("{name: a, sphere: 0.1, motion: {velocity: [1, 0, 0]}}", "the obstacle 'a' moves"),
        ("{sphere: 0}", r"obstacles\[0\].sphere is 0"),
    ],
)
def test_impossible_obstacles_are_one_sentence(text: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=reason) as raised:
        place = open_with_obstacles(balls_place(), obstacles_in(tmp_path, text))
        assert place.obstacles is not None
        require_clear_ends(place.obstacles, place.robot, ENDS)
    assert "\n" not in str(raised.value)


def test_the_command_refuses_a_file_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "stonehenge", "--obstacles", str(tmp_path / "none.yaml")]) == 2
    assert "there is no file" in capsys.readouterr().err


def test_a_flight_records_its_obstacles_in_its_command() -> None:
    request = FlyRequest(PlanRequest(ENDS), obstacles=Path("crates.yaml"))
    assert "--obstacles crates.yaml" in command_of(request, balls_place(), 20, 0.1)
