"""Experiments in the app: what the session makes of them, and what is read from the folder of results."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from nerfnav_app.jobs.events import JobFailed, JobFinished, JobResult, Progress
from nerfnav_app.places.ends import Ends
from nerfnav_app.queries.catalog import pending_queries
from nerfnav_app.queries.experiments import Experiments, ExperimentsQuery
from nerfnav_app.queries.query import Resources
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import actions as m
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.runs import ListExperiments, ShowResult, StartExperiment
from nerfnav_app.state.session import Session
from nerfnav_app.storage.experiment_store import FOLDER, ExperimentResult, ExperimentStore, lines
from nerfnav_app.storage.run_store import RunStore
from tests.app.doubles import balls_place


@pytest.fixture
def opened() -> Session:
    """A session in a place where nothing happens."""
    return replace(Session.opening("balls"), place=balls_place(), ends=Ends(), job=None)


def asked(session: Session) -> list[ExperimentsQuery]:
    """What the session asks of experiments."""
    return [query for query in pending_queries(session) if isinstance(query, ExperimentsQuery)]


@pytest.fixture
def store(tmp_path: Path) -> ExperimentStore:
    """A folder with the results of one experiment."""
    folder = tmp_path / FOLDER / "2026-01-02-030405-planners"
    folder.mkdir(parents=True)
    summary = {"methods": {"fast": {"cost": 12.3456, "failed": 0}}, "better": True, "worst": None}
    (folder / "results.json").write_text(json.dumps({"summary": summary}))
    cv2.imwrite(str(folder / "cost.png"), np.full((4, 6, 3), (1, 2, 3), np.uint8))
    return ExperimentStore(tmp_path)


def test_nothing_is_asked_before_somebody_wants_to_know(opened: Session) -> None:
    assert not asked(opened)
    (query,) = asked(reduce(opened, ListExperiments()))
    answered = reduce(
        reduce(opened, ListExperiments()), m.QueryAnswered(query, Experiments((("planners", "which is best"),)))
    )
    known = ExperimentsQuery.result_in(answered)
    assert not asked(answered) and known is not None and known.names == ("planners",)
    assert len(asked(reduce(answered, ListExperiments()))) == 1


def test_an_experiment_is_a_job_that_leaves_plan_and_flight_alone_and_shows_its_result(opened: Session) -> None:
    begun = reduce(opened, StartExperiment("planners", 3))
    assert begun.job is not None and begun.job.kind is JobKind.EXPERIMENT
    assert begun.experiments.asked == StartExperiment("planners", 3) and begun.flight is opened.flight
    on = reduce(begun, m.Reported(begun.job.id, Progress("trial, 1 of 3", 0.3)))
    assert on.job is not None and on.job.fraction == 0.3
    done = reduce(
        on,
        m.Reported(
            begun.job.id, JobFinished("experiment", JobResult(files=(Path("runs/experiments/x/results.json"),)))
        ),
    )
    assert done.job is None and done.experiments.show == "x"
    (query,) = asked(done)
    assert query.show == "x"


def test_an_experiment_that_fails_is_told_and_can_be_stopped(opened: Session) -> None:
    begun = reduce(opened, StartExperiment("nonsense", 3))
    assert begun.job is not None
    failed = reduce(begun, m.Reported(begun.job.id, JobFailed("experiment", "there is no such experiment")))
    assert failed.job is None and failed.notices[-1].title.endswith(JobKind.EXPERIMENT.verb)
    assert reduce(begun, m.Cancel()).job is None


def test_a_second_experiment_waits_for_the_first(opened: Session) -> None:
    begun = reduce(opened, StartExperiment("planners", 3))
    again = reduce(begun, StartExperiment("planners", 3))
    assert again.job == begun.job and again.notices[-1].title == "Still busy"


def test_results_come_with_their_numbers_and_figures(store: ExperimentStore) -> None:
    (name,) = store.names()
    result = store.result(name)
    assert result is not None
    assert dict(result.numbers) == {
        "methods.fast.cost": "12.3",
        "methods.fast.failed": "0",
        "better": "yes",
        "worst": "–",
    }
    assert [figure.shape for figure in result.figures] == [(4, 6, 3)]
    assert result.figures[0][0, 0].tolist() == [3, 2, 1]


@pytest.mark.parametrize("name", ["../../etc", "/etc", "..", "", "nobody", "a/../b", "x" * 500])
def test_no_name_leads_out_of_the_folder(store: ExperimentStore, name: str) -> None:
    reported = ExperimentsQuery(1, name).answer(Resources(balls_place(), RunStore(store.folder.parent)))
    assert reported.result is None and len(reported.earlier) == 1
    assert {known for known, _ in reported.known} >= {"planners", "collision-correlation"}


@pytest.mark.parametrize("text", ["", "[]", "{}", "{", '{"summary": 5}'])
def test_results_that_cannot_be_read_are_none_or_empty(store: ExperimentStore, text: str) -> None:
    (name,) = store.names()
    (store.folder / name / "results.json").write_text(text)
    result = store.result(name)
    assert result is None or isinstance(result, ExperimentResult)


def test_a_folder_that_is_not_there_holds_nothing(tmp_path: Path) -> None:
    assert ExperimentStore(tmp_path / "nowhere").names() == ()


def test_a_new_folder_is_named_after_the_experiment(tmp_path: Path) -> None:
    assert ExperimentStore(tmp_path).new("planners").name.endswith("-planners")


def test_lists_and_words_are_lines_too() -> None:
    assert lines({"a": [1.23456, "b"], "c_d": "e"}) == [("a", "1.23, b"), ("c d", "e")]


def test_looking_at_an_earlier_result_asks_for_it(opened: Session) -> None:
    (query,) = asked(reduce(reduce(opened, ListExperiments()), ShowResult("earlier")))
    assert query.show == "earlier"
