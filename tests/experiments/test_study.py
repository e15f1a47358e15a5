"""Trials in one process and in many."""

import os
import sys
from pathlib import Path

import pytest
import torch

from nerfnav.core.errors import InvalidInputError, MissingExtraError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.study import Journal, Study, TrialDone, run_trials
from tests.experiments.places import column


def squared(arena: Arena, item: int) -> tuple[int, int, str]:
    return item * item, os.getpid(), arena.scene.name


def finished(study: Study, items: list[int]) -> tuple[list[TrialDone], list[tuple[int, int, str]]]:
    trials, reported = run_trials(study, "squaring", squared, items), []
    while True:
        try:
            reported.append(next(trials))
        except StopIteration as end:
            return reported, end.value


def test_answers_come_in_the_order_of_the_items_and_every_trial_is_reported() -> None:
    reported, answers = finished(Study(column), [3, 1, 2])
    assert [answer[0] for answer in answers] == [9, 1, 4]
    assert [step.done for step in reported] == [0, 1, 2, 3]
    assert {(step.label, step.total) for step in reported} == {("squaring", 3)}
    assert {answer[1] for answer in answers} == {os.getpid()}


@pytest.mark.slow
def test_trials_run_in_other_processes_and_give_the_same_answers() -> None:
    _, answers = finished(Study(column, jobs=2), [3, 1, 2])
    assert [(answer[0], answer[2]) for answer in answers] == [(9, "column"), (1, "column"), (4, "column")]
    assert os.getpid() not in {answer[1] for answer in answers}


def test_a_trial_leaves_the_threads_of_torch_as_they_were() -> None:
    before = torch.get_num_threads()
    finished(Study(column), [1])
    assert torch.get_num_threads() == before


def test_an_error_in_a_trial_reaches_the_caller() -> None:
    with pytest.raises(TypeError):
        finished(Study(column), ["word"])  # type: ignore[list-item]


def test_a_cluster_without_its_library_is_refused_in_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)  # makes its import fail, installed or not
    with pytest.raises(MissingExtraError, match=r"--ray needs ray, .* pip install 'nerfnav\[ray\]'"):
        finished(Study(column, ray="auto"), [1])


@pytest.mark.parametrize("name", ["trials", "jobs"])
def test_numbers_below_one_are_refused(name: str) -> None:
    with pytest.raises(InvalidInputError, match=f"{name} must be 1 or more, not 0"):
        Study(column, **{name: 0})


def test_more_trials_than_there_are_entries_are_refused() -> None:
    assert Study(column, trials=2).first([5, 6, 7], "tasks") == [5, 6]
    assert Study(column).first([5, 6, 7], "tasks") == [5, 6, 7]
    with pytest.raises(InvalidInputError, match="there are 3 tasks"):
        Study(column, trials=4).first([5, 6, 7], "tasks")


def refusing(arena: Arena, item: int) -> int:
    if item == 7:
        raise InvalidInputError("not seven")
    return item * item


def test_an_experiment_that_was_interrupted_goes_on_where_it_was(tmp_path: Path) -> None:
    study = Study(column, journal=Journal(tmp_path / "trials.jsonl", "squares"))
    with pytest.raises(InvalidInputError):
        list(run_trials(study, "squaring", refusing, [3, 1, 7]))
    with (tmp_path / "trials.jsonl").open("a") as stream:
        stream.write('["squares: 2 7", 4')  # a line that was not written to its end
    reported, answers = finished(study, [3, 1, 2])
    assert [step.done for step in reported] == [2, 3]
    assert answers[:2] == [9, 1] and answers[2][0] == 4
    other = Study(column, journal=Journal(tmp_path / "trials.jsonl", "cubes"))
    assert finished(other, [3])[0][0].done == 0, "answers about something else do not count"
