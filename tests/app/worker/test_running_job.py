"""A job step by step: which of its events are told."""

from typing import Any

import pytest

from nerfnav.navigation import NavigationStep
from nerfnav_app.jobs.events import JobFinished, JobResult, Progress
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.state.job import Job, JobKind
from nerfnav_app.state.session import Session
from nerfnav_app.worker import running_job
from nerfnav_app.worker.running_job import RunningJob
from tests.app.doubles import ScriptedWork, filter_step, flight_step, plan_step

_ENDS = Ends(End((-0.7, 0.0, 0.4)), End((0.7, 0.0, 0.4)))
_FIRST = [plan_step(_ENDS, k) for k in range(3)]
_WITHIN = [filter_step(_ENDS, 0), filter_step(_ENDS, 1), plan_step(_ENDS, 0), plan_step(_ENDS, 1)]
_STEPS = [flight_step(_ENDS, k) for k in range(3)]
_FLIGHT = [*_FIRST, _STEPS[0], Progress("flying", 0.1), *_WITHIN, _STEPS[1], *_WITHIN, _STEPS[2]]


def _told(kind: JobKind, script: list[Any]) -> list[Any]:
    """All that a job of this script tells."""
    job = Job(1, kind, _ENDS)
    running, told = RunningJob(job, ScriptedWork({kind: [*script, JobResult()]}), Session.opening("balls")), []
    while running.may_go_on(job):
        told.append(running.next_event(lambda progress: None))
    assert isinstance(told.pop(), JobFinished)
    return told


def test_iterations_between_two_time_steps_are_told_where_they_are_slow_enough_to_be_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(running_job, "_ITERATION_S", 0.0)
    told = _told(JobKind.FLY, _FLIGHT)
    assert len(told) == len(_FLIGHT)
    assert all(event is expected for event, expected in zip(told, _FLIGHT, strict=True))


def test_iterations_that_nobody_would_see_are_passed_over_and_time_steps_never(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(running_job, "_ITERATION_S", 1e9)
    told = _told(JobKind.FLY, _FLIGHT)
    assert [id(event) for event in told] == [id(event) for event in (*_FIRST, *_FLIGHT[3:5], *_STEPS[1:])]
    assert sum(isinstance(event, NavigationStep) for event in told) == len(_STEPS)


def test_each_iteration_of_a_plan_is_told_however_fast_they_come(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running_job, "_ITERATION_S", 1e9)
    assert len(_told(JobKind.PLAN, _FIRST)) == len(_FIRST)
