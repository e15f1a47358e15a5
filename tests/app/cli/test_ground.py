"""Robots on the ground in commands: their ends are put on the floor, or refused in one sentence."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import save_field
from nerfnav.planner import PlanOutcome, PlanResult, PlanStep
from nerfnav.robots import load
from nerfnav_app.cli.main import main
from nerfnav_app.jobs.fly import fly
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.plan import plan
from nerfnav_app.places.ends import End, EndRole, Ends
from nerfnav_app.places.place import Place
from tests.app.following import followed
from tests.planner.grounds import FLOOR_M, hall
from tests.planner.objective.test_default_ends import field_of

Capture = pytest.CaptureFixture[str]
HALF = 0.5 * load("diffdrive").body.extents[2]
HALL = Place("hall", hall(), None, load("diffdrive"))
ALOFT = Ends(End((-1.2, -0.5, 0.8)), End((-0.3, -0.4, 0.8)))
ROUTE = ["--robot", "diffdrive", "--start", "-1.2", "-0.5", "0.8", "--goal"]
ACROSS, ABOVE_HOLE = ["-0.3", "-0.4", "0.7"], ["0.55", "-0.4", "0.5"]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("hall") / "hall.npz"
    save_field(hall(), path)
    return str(path)


def summary_of(words: list[str], capture: Capture) -> tuple[dict[str, Any], str]:
    """The object that a command prints, and its notes."""
    assert main([*words, "--json"]) in (0, 2)
    out, err = capture.readouterr()
    return json.loads(out.splitlines()[-1]), err


@pytest.mark.slow
@pytest.mark.parametrize("command", ["plan", "fly"])
def test_ends_in_the_air_are_put_on_the_floor_which_is_told(
    file: str, command: str, capsys: Capture, tmp_path: Path
) -> None:
    quick = [] if command == "plan" else ["--open-loop"]
    words = [command, file, *ROUTE, *ACROSS, *quick, "--steps", "20", "--out", str(tmp_path / "out")]
    summary, notes = summary_of(words, capsys)
    start, goal = (summary["ends"][which.value] for which in EndRole)
    assert start[:2] == [-1.2, -0.5] and goal[:2] == [-0.3, -0.4] and start[2] == goal[2]
    assert 0 < start[2] - HALF - FLOOR_M < 0.08
    assert summary["ends"]["moved_m"] == {"start": round(start[2] - 0.8, 4), "goal": round(goal[2] - 0.7, 4)}
    assert notes.count("stands on the floor") == 1
    again = [command, file, "--robot", "diffdrive", "--start", *map(str, start), "--goal", *map(str, goal), *quick]
    summary, notes = summary_of([*again, "--steps", "20", "--out", str(tmp_path / "again")], capsys)
    assert "ends" not in summary and "stands on the floor" not in notes


@pytest.mark.parametrize("command", ["plan", "fly"])
@pytest.mark.parametrize(
    ("goal", "reason"),
    [
        (ABOVE_HOLE, "would stand in the air at the goal: there is no floor within 0.46 m"),
        (["0.3", "-0.4", "0.5"], "would not stand level at the goal"),
        (["-1.0", "0.5", "0.9"], "stays on one level"),
        (["9", "0", "0.2"], "outside the field"),
    ],
)
def test_without_a_floor_one_sentence_refuses(
    file: str, command: str, goal: list[str], reason: str, capsys: Capture, tmp_path: Path
) -> None:
    assert main([command, file, *ROUTE, *goal, "--out", str(tmp_path / "out"), "--json"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and len(err.strip().splitlines()) == 1 and reason in err
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize("draft", [True, False])
def test_a_plan_begins_and_ends_on_the_floor_while_a_hand_holds_its_ends_in_the_air(draft: bool) -> None:
    events, _ = followed(plan.run(plan.PlanRequest(ALOFT, draft=draft), HALL))
    steps = [event for event in events if isinstance(event, PlanStep)]
    heights = steps[-1].motion.states.position[:, 2]
    assert bool((heights == heights[0]).all()) and 0 < heights[0].item() - HALF - FLOOR_M < 0.08


def test_both_jobs_refuse_a_hole_before_they_begin(tmp_path: Path) -> None:
    route = plan.PlanRequest(replace(ALOFT, goal=End((0.55, -0.4, 0.5))), out=tmp_path / "plan")
    with pytest.raises(InvalidInputError, match="in the air at the goal"):
        next(plan.run(route, HALL))
    with pytest.raises(InvalidInputError, match="in the air at the goal"):
        next(fly.run(FlyRequest(route, out=tmp_path / "fly"), HALL))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("draft", [True, False])
def test_a_robot_on_the_ground_drives_over_a_bridge_and_not_through_the_trench_beside_it(draft: bool) -> None:
    before, beyond = ((-2, -2, -1), (0.3, 2, FLOOR_M)), ((0.8, -2, -1), (2, 2, FLOOR_M))
    bridged = field_of(((-1.5, -1, 0), (1.5, 1, 1)), before, beyond, ((0.2, 0.2, -1), (0.9, 0.8, FLOOR_M)))
    request = plan.PlanRequest(Ends(End((-0.3, -0.4, 0.17)), End((1.2, -0.5, 0.17))), shortest=True, draft=draft)
    events, _ = followed(plan.run(request, replace(HALL, field=bridged)))
    found = [event for event in events if isinstance(event, PlanResult)][-1]
    over = [y for x, y, _ in found.motion.states.position.tolist() if 0.3 < x < 0.8]
    assert found.outcome is PlanOutcome.CONVERGED and over and all(0.2 < y < 0.8 for y in over)
    events, _ = followed(plan.run(request, HALL))
    assert [event for event in events if isinstance(event, PlanResult)][-1].outcome is PlanOutcome.NO_PATH
