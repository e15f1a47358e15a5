"""The command of a flight asks for the same flight."""

import os
import shlex
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from queue import SimpleQueue
from typing import Any
from unittest.mock import ANY

import numpy as np
import pytest

from nerfnav.navigation.episode import Episode
from nerfnav.navigation.flight import NavigateConfig, OperatorRequests
from nerfnav.planner import PlanResult, planners
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.robots.noise import StateNoise
from nerfnav_app.cli.commands.fly import make_request
from nerfnav_app.cli.main import parse
from nerfnav_app.jobs.events import JobFinished
from nerfnav_app.jobs.fly.command import command_of
from nerfnav_app.jobs.fly.request import FlyRequest, OperatorRecorder
from nerfnav_app.jobs.plan import plan as plan_job
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.place import Place, open_place
from nerfnav_app.state.actions import Reported
from nerfnav_app.state.flight import FlightSettings
from nerfnav_app.state.job import Job, JobKind
from nerfnav_app.state.plan import PlanRecord, PlanSettings
from nerfnav_app.state.session import Session
from nerfnav_app.storage.run_metadata import RunMetadata
from nerfnav_app.storage.run_store import RunStore
from nerfnav_app.worker.backend import NavigationBackend
from nerfnav_app.worker.operator_requests import SessionRequests
from nerfnav_app.worker.worker import Posted, Worker
from tests.waiting import PATIENCE_S

FREE = Ends(End((0.39, -0.67, 0.2000001)), End((-0.4, 0.55, 0.16), -0.5))


@pytest.fixture(scope="module")
def stones() -> Place:
    return open_place("stonehenge")


def session_of(place: Place, **changes: Any) -> Session:
    """A session in Stonehenge, which flies its first task."""
    task = place.tasks[0]
    known: dict[str, Any] = {"place": place, "task": task.name, "ends": Ends.of_task(task)}
    return Session("stonehenge", **known | changes)


def request_of(session: Session, runs: RunStore | None = None, first: PlanRecord | None = None) -> FlyRequest:
    """The flight of the page."""
    assert session.place is not None
    job = Job(7, JobKind.FLY, session.ends, first_plan=first)
    backend = NavigationBackend(runs=runs)
    return backend._fly_request(session, job, session.place, SessionRequests(job, session.place))


def read_back(command: str) -> FlyRequest:
    """The request of a command line."""
    program, *words = shlex.split(command)
    assert program == "nerfnav"
    _, arguments = parse(words)
    return make_request(arguments, arguments.open())


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"ends": FREE, "task": None},
        {"flight_settings": FlightSettings(seed=3, position_noise_m=0.0123456789, attitude_noise_rad=0.01)},
        {"flight_settings": FlightSettings(open_loop=True, world="physical", realtime=True)},
        {"plan_settings": PlanSettings(max_collision=0.25)},
        {"plan_settings": PlanSettings(risk_weight=30.0)},
        {"plan_settings": PlanSettings(risk_weight=0.0)},
        {"plan_settings": PlanSettings(paper_cost=True)},
        {"plan_settings": PlanSettings(weights=CostWeights(collision=3.5e-7))},
    ],
)
def test_the_command_asks_for_the_flight_of_the_page(stones: Place, changes: dict[str, Any]) -> None:
    asked = request_of(session_of(stones, **changes))
    again = read_back(command_of(asked, stones, 20, 0.1))
    one, other = asked.route, again.route
    for name in ("ends", "planner", "settings", "flight_settings", "world", "unknown", "max_collision"):
        assert getattr(other, name) == getattr(one, name), name
    flights = [replace(route.flight, open_loop=False) for route in (one, other)]
    assert flights[0] == flights[1] and not other.shortest and (other.steps, other.dt) == (20, 0.1)
    for name in ("open_loop", "seed", "realtime", "estimator", "task", "source"):
        assert getattr(again, name) == getattr(asked, name), name


@pytest.mark.parametrize(("steps", "dt"), [(20, 0.1), (33, 0.1), (24, 2.35 / 24), (20, 0.123456789), (61, 1e-1 / 3)])
@pytest.mark.parametrize("changes", [{}, {"ends": FREE, "task": None}])
def test_the_command_has_the_duration_that_was_found(
    stones: Place, steps: int, dt: float, changes: dict[str, Any]
) -> None:
    route = read_back(command_of(request_of(session_of(stones, **changes)), stones, steps, dt)).route
    assert (route.steps, route.dt, route.shortest) == (steps, dt, False)


def test_the_share_with_too_little_to_see_is_in_the_command(stones: Place) -> None:
    asked = request_of(session_of(stones))
    asked = replace(asked, route=replace(asked.route, max_blind=0.3))
    assert read_back(command_of(asked, stones, 20, 0.1)).route.max_blind == 0.3


def test_settings_of_any_depth_and_kind_are_in_the_command(stones: Place) -> None:
    flight = NavigateConfig(noise=StateNoise(position_m=1e-5), look_first=False, most_risk=0.5)
    flight = replace(flight, filter=replace(flight.filter, adaptive=False, exact_covariance=True))
    pyramid = replace(flight.filter.pyramid, iterations=(3, 4, 5))
    flight = replace(flight, filter=replace(flight.filter, pyramid=pyramid))
    entry = planners.load("minsnap")
    settings = replace(entry.config(), weights=CostWeights(control=0.25))
    route = plan_job.PlanRequest(FREE, planner="minsnap", config=settings, flight=flight)
    again = read_back(command_of(FlyRequest(route, source="stonehenge"), stones, 20, 0.1))
    assert again.route.flight == flight and again.route.settings == settings
    assert again.route.flight_settings == route.flight_settings


def test_a_plain_flight_has_a_short_command_and_names_are_quoted(stones: Place) -> None:
    assert command_of(request_of(session_of(stones)), stones, 20, 0.1) == "nerfnav fly stonehenge"
    route = plan_job.PlanRequest(FREE)
    command = command_of(FlyRequest(route, source="my places/a b.npz", seed=3), stones, 20, 0.1)
    assert "'my places/a b.npz'" in command and command.endswith("--seed 3")


def test_requests_of_the_operator_are_noted_once_each() -> None:
    goal, other = End((0.0, 0.0, 0.5)).state(), End((0.1, 0.0, 0.5)).state()
    asked = [OperatorRequests(goal=goal), OperatorRequests(goal=other, gust=StateNoise()), OperatorRequests(other)]
    left = iter(asked)
    recorder = OperatorRecorder(lambda: next(left), goal)
    recorder()
    assert recorder.made == ()
    recorder()
    recorder()
    assert recorder.made == ("another goal", "a gust") and recorder.goal is other


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {"flight_settings": FlightSettings(seed=5, position_noise_m=0.0123)},
        pytest.param(
            {"ends": FREE, "task": None, "plan_settings": PlanSettings(duration_s=2.35, shortest=True)},
            marks=pytest.mark.nightly,  # half a minute, as long as the other
        ),
    ],
    ids=["a task", "a found duration"],
)
def test_a_flight_of_the_page_and_its_command_are_equal_step_for_step(
    tmp_path: Path, changes: dict[str, Any]
) -> None:
    with pytest.MonkeyPatch.context() as patch, ProcessPoolExecutor(1, get_context("spawn")) as page:
        for library, threads in {"OPENBLAS": "1", "OMP": "2", "NUMBA": "2"}.items():  # as `nerfnav serve` on two cores
            patch.setenv(f"{library}_NUM_THREADS", threads)
        flown = page.submit(_fly_on_page, changes, tmp_path / "runs").result()
    command = RunMetadata.load(flown).command
    assert command is not None
    for threads in ("1", "2"):
        out = tmp_path / f"again{threads}"
        words = [*shlex.split(command)[1:], "--out", str(out), "--json"]
        code = "import sys; from nerfnav_app.cli.main import main; sys.exit(main(sys.argv[1:]))"
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "NUMBA_NUM_THREADS": threads}
        environment.pop("OPENBLAS_NUM_THREADS", None)
        subprocess.run([sys.executable, "-c", code, *words], env=environment, check=True)
        _assert_equal(flown, out)


def _fly_on_page(changes: dict[str, Any], runs: Path) -> Path:
    """Plan and fly by the page's worker; return the folder of the flight."""
    session = session_of(open_place("stonehenge"), **changes)
    posted: SimpleQueue[Any] = SimpleQueue()

    def post(message: Posted) -> None:
        if isinstance(message, Reported):
            posted.put(message.event)

    worker = Worker(NavigationBackend(runs=RunStore(runs)), post)

    def do(job: Job) -> list[Any]:
        worker.follow(replace(session, job=job))
        return list(iter(lambda: posted.get(timeout=PATIENCE_S), JobFinished(job.kind.value, ANY)))

    worker.start()
    planned = [event for event in do(Job(1, JobKind.PLAN, session.ends)) if isinstance(event, PlanResult)][-1]
    do(Job(2, JobKind.FLY, session.ends, session.new_plan(session.ends).with_step(planned)))
    worker.stop()
    (flown,) = runs.iterdir()
    return flown


def _assert_equal(one: Path, other: Path) -> None:
    """Compare all arrays of two episodes but the times of computing."""
    assert Episode.load(one).outcome is Episode.load(other).outcome
    with np.load(one / "episode.npz") as first, np.load(other / "episode.npz") as second:
        assert sorted(first.files) == sorted(second.files)
        for name in first.files:
            if not name.endswith("_ms"):
                np.testing.assert_array_equal(first[name], second[name], err_msg=name)
