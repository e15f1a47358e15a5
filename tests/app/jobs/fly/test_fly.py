"""Flying as a job: its events, its end, landing early."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav.core.errors import UnknownNameError
from nerfnav.geometry import Box
from nerfnav.navigation.episode import Episode, EpisodeOutcome, NavigationStep
from nerfnav.navigation.flight import NavigateConfig, OperatorRequests
from nerfnav.navigation.simulator import Simulator
from nerfnav.planner.solvers.adam import PlanConfig
from nerfnav.planner.steps import PlanStep
from nerfnav.robots import RigidState
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult
from nerfnav_app.jobs.fly import setup
from nerfnav_app.jobs.fly.fly import run
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.jobs.plan.plan import run as plan_job
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.place import Place, open_place
from nerfnav_app.storage.run_metadata import RunMetadata
from nerfnav_app.storage.step_log import read_steps
from tests.app.following import followed, result_of

ENDS = Ends(End((-0.6, -0.6, 0.5)), End((0.6, -0.6, 0.5)))
ROUTE = PlanRequest(ENDS, planner="paper", config=PlanConfig(iterations=5), again=PlanConfig(iterations=2))
BLIND = FlyRequest(ROUTE, open_loop=True)


@pytest.fixture(scope="module")
def place(field_file: Path) -> Place:
    return open_place(str(field_file))


def flown(job: JobEvents) -> tuple[list[NavigationStep], JobResult]:
    seen, finished = followed(job)
    return [event for event in seen if isinstance(event, NavigationStep)], finished


def test_a_flight_tells_its_steps_and_then_its_numbers(place: Place) -> None:
    steps, finished = flown(run(BLIND, place))
    assert [step.index for step in steps] == list(range(21))
    assert finished.summary["steps"] == 20
    assert finished.summary["mesh_collision_steps"] is None, "nobody knows what is true here"


def test_a_plan_that_is_already_made_is_flown(place: Place) -> None:
    (*_, last), _ = [e for e in plan_job(ROUTE, place) if isinstance(e, PlanStep)], None
    events = list(run(replace(BLIND, plan=last.motion), place))
    steps = [event for event in events if isinstance(event, NavigationStep)]
    assert not [event for event in events if isinstance(event, PlanStep)]
    assert steps[1].action is not None
    assert torch.equal(steps[1].action, last.motion.actions[0])


def test_a_flight_that_is_asked_to_land_keeps_what_was_flown(place: Place, tmp_path: Path) -> None:
    job = run(replace(BLIND, out=tmp_path / "run"), place)
    event: JobEvent | None = next(job)
    while not (isinstance(event, NavigationStep) and event.index == 4):
        event = next(job)
    job.send(True)
    summary = result_of(job).summary
    assert summary["outcome"] == "stopped"
    assert summary["steps"] == 4
    assert Episode.load(tmp_path / "run").outcome is EpisodeOutcome.STOPPED
    assert (tmp_path / "run" / "trajectory.csv").is_file()


def test_a_flight_that_hits_something_is_over_and_stored_unless_it_flies_on(
    place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def touches(before: RigidState, after: RigidState) -> bool:
        return bool(before.position[0] < 0 <= after.position[0])

    monkeypatch.setattr(setup, "contact_function", lambda place: touches)
    steps, _ = flown(run(replace(BLIND, out=tmp_path / "hit"), place))
    assert [step.index for step in steps if step.touched] == [steps[-1].index] and len(steps) < 21
    assert RunMetadata.load(tmp_path / "hit").outcome == "collided"
    assert Episode.load(tmp_path / "hit").outcome is EpisodeOutcome.COLLIDED
    route = replace(ROUTE, flight=NavigateConfig(fly_on=True))
    steps, finished = flown(run(replace(BLIND, route=route), place))
    assert len(steps) == 21 and finished.summary["outcome"] == "collided"


def test_a_flight_ends_where_it_leaves_the_field(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    box = Box(place.field.box.lower, torch.tensor([-0.3, 1.0, 1.0]))
    monkeypatch.setattr(setup, "Simulator", lambda *parts, **others: Simulator(*parts, **(others | {"box": box})))
    steps, finished = flown(run(BLIND, place))
    assert finished.summary["outcome"] == "outside" and len(steps) < 21


def test_a_flight_that_is_cancelled_at_the_start_leaves_nothing(place: Place, tmp_path: Path) -> None:
    job = run(replace(BLIND, out=tmp_path / "run"), place)
    for event in job:
        if isinstance(event, NavigationStep):
            break
    job.close()
    assert not (tmp_path / "run").exists()


def test_a_flight_that_is_stopped_on_the_way_keeps_the_log_of_what_was_flown(place: Place, tmp_path: Path) -> None:
    job = run(replace(BLIND, out=tmp_path / "run", task="an example"), place)
    for event in job:
        if isinstance(event, NavigationStep) and event.index == 3:
            break
    assert RunMetadata.load(tmp_path / "run").outcome is None, "a flight under way has no outcome"
    job.close()
    known = RunMetadata.load(tmp_path / "run")
    assert known.outcome == "stopped" and known.metrics["steps"] == 3 and known.task == "an example"
    assert [step.index for step in read_steps(tmp_path / "run")] == [0, 1, 2, 3]


def test_a_name_that_is_no_estimator_is_refused(place: Place) -> None:
    with pytest.raises(UnknownNameError, match=r"no estimator named 'luck'; known are: "):
        list(run(replace(BLIND, estimator="luck"), place))


def test_a_flight_whose_goal_was_moved_is_filed_under_no_task(place: Place, tmp_path: Path) -> None:
    other = End((0.6, -0.4, 0.5))
    for name, goal, task in (("kept", ENDS.goal, "home"), ("moved", other, None)):
        requests = OperatorRequests(goal=goal.state())
        asked = replace(BLIND, task="home", operator=lambda requests=requests: requests, out=tmp_path / name)
        flown(run(asked, place))
        about = RunMetadata.load(tmp_path / name)
        assert about.task == task and about.ends == Ends(ENDS.start, goal)
