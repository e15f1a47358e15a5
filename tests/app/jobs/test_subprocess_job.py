"""Jobs in processes of their own."""

import os
import time
from functools import partial
from pathlib import Path

import pytest

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.subprocess_job import run_in_subprocess
from tests.app.following import followed
from tests.waiting import PATIENCE_S


def reported(folder: Path) -> JobEvents:
    yield Progress("half", 0.5)
    return JobResult({"process": os.getpid()}, (folder / "result",))


def refused(reason: str) -> JobEvents:
    yield Progress("begun", 0.1)
    raise InvalidInputError(reason)


def endless(folder: Path) -> JobEvents:
    yield Progress("begun", 0.1)
    (folder / "process").write_text(str(os.getpid()))
    while True:
        time.sleep(60)


def broken() -> JobEvents:
    yield Progress("begun", 0.1)
    os._exit(3)


@pytest.mark.slow
def test_the_events_come_from_another_process_in_their_order(tmp_path: Path) -> None:
    events, finished = followed(run_in_subprocess(partial(reported, tmp_path)))
    assert finished.summary["process"] != os.getpid() and finished.files == (tmp_path / "result",)
    told_here = [event for event in events if not isinstance(event, Progress) or "process" not in event.label]
    assert told_here[0] == Progress("half", 0.5) and set(told_here) == {Progress("half", 0.5)}


@pytest.mark.slow
def test_what_the_job_refuses_is_told_in_its_words() -> None:
    with pytest.raises(NerfnavError, match=r"^there are no such trials$"):
        list(run_in_subprocess(partial(refused, "there are no such trials")))


@pytest.mark.slow
def test_a_job_in_the_middle_of_a_long_step_goes_on_telling_and_ends_when_it_is_closed(tmp_path: Path) -> None:
    job = run_in_subprocess(partial(endless, tmp_path))
    end = time.monotonic() + PATIENCE_S
    while next(job) != Progress("begun", 0.1) or not (tmp_path / "process").exists():
        assert time.monotonic() < end, "the job did not begin"
    assert next(job) == Progress("begun", 0.1), "how far it is is told again"
    process = int((tmp_path / "process").read_text())
    job.close()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


@pytest.mark.slow
def test_a_process_that_ends_too_early_is_told() -> None:
    with pytest.raises(NerfnavError, match="ended before it was done"):
        list(run_in_subprocess(broken))
