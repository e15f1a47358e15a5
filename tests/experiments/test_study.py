"""Trials in one process and in many."""

import json
import os
import select
import signal
import sys
import time
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from unittest.mock import ANY

import pytest
import torch

from nerfnav.core.errors import InvalidInputError, MissingExtraError, NerfnavError
from nerfnav.core.jit import threads
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.study import Journal, Study, TrialDone, run_trials
from tests.experiments.places import column


def squared(arena: Arena, item: int) -> tuple[int, int, str]:
    return item * item, os.getpid(), arena.scene.name


def finished(study: Study, items: list[int], trial: Any = squared) -> tuple[list[TrialDone], list[Any]]:
    trials, reported = run_trials(study, "squaring", trial, items), []
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


def test_trials_run_in_other_processes_and_give_the_same_answers() -> None:
    _, answers = finished(Study(column, jobs=2), [3, 1, 2])
    assert [(answer[0], answer[2]) for answer in answers] == [(9, "column"), (1, "column"), (4, "column")]
    assert os.getpid() not in {answer[1] for answer in answers}


def asking(arena: Arena, item: int) -> tuple[int, int]:
    with threads(item) as used:
        return used, torch.get_num_threads()


@pytest.mark.parametrize("jobs", [None, 2])
def test_a_trial_has_one_thread_whatever_it_asks_for(jobs: int | None) -> None:
    assert finished(Study(column, jobs=jobs), [2, 3], asking)[1] == [(1, 1), (1, 1)]


def test_a_trial_leaves_the_threads_of_torch_as_they_were() -> None:
    before = torch.get_num_threads()
    finished(Study(column), [1])
    assert torch.get_num_threads() == before


@pytest.mark.parametrize("jobs", [None, 2])
def test_a_trial_with_an_error_fails_with_its_reason_and_the_others_go_on(jobs: int | None) -> None:
    reported, answers = finished(Study(column, seed=5, jobs=jobs), [3, 7, 8, 2], refusing)
    assert answers == [9, 4]
    ends = {end.trial: end for step in reported for end in step.ended}
    assert {index: end.failed for index, end in ends.items()} == {
        0: None, 1: "not seven", 2: "ZeroDivisionError: integer division or modulo by zero", 3: None,
    }  # fmt: skip
    assert {end.seed for end in ends.values()} == {5} and all(end.wall_s >= 0 for end in ends.values())


def dying(arena: Arena, item: int) -> int:
    if item == 2:
        os.kill(os.getpid(), signal.SIGKILL)  # as the kernel does where memory runs out
    return item


def test_a_killed_process_ends_the_series_in_one_sentence_and_the_journal_keeps_the_others(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "results.jsonl", "column")
    with pytest.raises(NerfnavError, match=r"a process of the trials was killed, .* fewer jobs"):
        finished(Study(column, jobs=2, journal=journal), [0, 1, 2, 3], dying)
    assert {0, 1} & journal.ends("squaring").keys() and 2 not in journal.ends("squaring")
    assert finished(Study(column, jobs=2, journal=journal), [0, 1, 2, 3])[1][2] == [4, ANY, "column"]


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux only")
def test_no_process_of_the_trials_outlives_the_killed_one_that_started_them() -> None:
    reader, writer = os.pipe()  # all processes have the writer; the reader ends with the last of them
    starting = get_context("fork").Process(target=end_in_the_middle)
    starting.start()
    os.close(writer)
    starting.join()
    assert starting.exitcode == -signal.SIGKILL
    assert select.select([reader], [], [], 20)[0] and os.read(reader, 1) == b""
    os.close(reader)


def end_in_the_middle() -> None:
    for step in run_trials(Study(column, jobs=2), "resting", resting, list(range(16))):
        if step.done == 4:
            os.kill(os.getpid(), signal.SIGKILL)


def test_a_trial_that_lacks_a_library_ends_the_series() -> None:
    with pytest.raises(NerfnavError, match=r"one needs two, .* pip install 'nerfnav\[three\]'"):
        finished(Study(column), [1], lacking)


def test_a_cluster_without_its_library_is_refused_in_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)  # makes its import fail, installed or not
    with pytest.raises(MissingExtraError, match=r"--ray needs ray, .* pip install 'nerfnav\[ray\]'"):
        finished(Study(column, ray="auto"), [1])


@pytest.mark.parametrize("name", ["trials", "jobs"])
def test_numbers_below_one_are_refused(name: str) -> None:
    with pytest.raises(InvalidInputError, match=f"{name} must be 1 or more, not 0"):
        Study(column, **{name: 0})


@pytest.mark.parametrize("seed", [-1, 2**32])
def test_seeds_that_generators_do_not_take_are_refused(seed: int) -> None:
    with pytest.raises(InvalidInputError, match="seed must be from 0 to 4294967295, not"):
        Study(column, seed=seed)


def test_more_trials_than_there_are_entries_are_refused() -> None:
    assert Study(column, trials=2).first([5, 6, 7], "tasks") == [5, 6]
    assert Study(column).first([5, 6, 7], "tasks") == [5, 6, 7]
    with pytest.raises(InvalidInputError, match="there are 3 tasks"):
        Study(column, trials=4).first([5, 6, 7], "tasks")


def refusing(arena: Arena, item: int) -> int:
    if item == 7:
        raise InvalidInputError("not seven")
    return item * item // (item != 8)


def lacking(arena: Arena, item: int) -> int:
    raise MissingExtraError("one", "two", "three")


def test_an_experiment_that_was_interrupted_goes_on_where_it_was(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "results.jsonl", "column")
    trials = run_trials(Study(column, journal=journal), "squaring", refusing, [3, 7, 2])
    assert [next(trials).done for _ in range(3)] == [0, 1, 2]
    trials.close()
    with journal.path.open("a") as stream:
        stream.write('{"place": "column", "sett')  # a line that was not written to its end
    assert journal.drop_cut_line() and not journal.drop_cut_line()
    reported, answers = finished(Study(column, journal=journal), [3, 7, 2], refusing)
    assert [step.done for step in reported] == [2, 3] and answers == [9, 4]
    assert [end.failed for end in reported[0].ended] == [None, "not seven"]
    lines = [json.loads(line) for line in journal.path.read_text().splitlines()]
    assert [(line["trial"], line["failed"], line["answer"]) for line in lines] == [
        (0, None, 9), (1, "not seven", None), (2, None, 4),
    ]  # fmt: skip


@pytest.mark.parametrize("other", [{"place": "church"}, {"setting": "risk-weight=3"}])
def test_trials_of_another_place_or_setting_do_not_count(tmp_path: Path, other: dict[str, str]) -> None:
    path = tmp_path / "results.jsonl"
    finished(Study(column, journal=Journal(path, "column")), [3])
    assert finished(Study(column, journal=Journal(path, **{"place": "column"} | other)), [3])[0][0].done == 0


@pytest.mark.parametrize(
    ("line", "message"),
    [("[1, 2]", "line 1"), ("{\"place\": 3}", "line 1"), ("\x00\x00", "not readable as JSON"), ("{}", "line 1")],
)
def test_a_damaged_line_is_refused_with_its_number(tmp_path: Path, line: str, message: str) -> None:
    (tmp_path / "results.jsonl").write_text(line + "\n")
    with pytest.raises(InvalidInputError, match=message):
        finished(Study(column, journal=Journal(tmp_path / "results.jsonl")), [3])


def test_answers_are_the_same_in_the_first_run_and_in_one_that_continues(tmp_path: Path) -> None:
    study = Study(column, journal=Journal(tmp_path / "results.jsonl"))
    first = finished(study, [3], pair)[1]
    assert first == finished(study, [3], pair)[1] == [{"pair": [3, 0.1]}]


def pair(arena: Arena, item: int) -> dict[str, Any]:
    return {"pair": (item, 0.1)}


def resting(arena: Arena, item: int) -> int:
    time.sleep(0.2)
    return item * item


@pytest.mark.slow
def test_a_node_that_is_lost_loses_and_repeats_no_trial(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster  # type: ignore[import-not-found]

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    node = cluster.add_node(num_cpus=1)
    try:
        journal = Journal(tmp_path / "results.jsonl")
        trials = run_trials(Study(column, ray=cluster.address, journal=journal), "squaring", resting, list(range(16)))
        while next(trials).done < 6:
            pass
        cluster.remove_node(node, allow_graceful=False)
        done = [step.done for step in trials]
    finally:
        cluster.shutdown()
    assert done == list(range(7, 17))
    answers = {end.trial: end.answer for end in journal.ends("squaring").values()}
    assert answers == {item: item * item for item in range(16)}
    assert len(journal.path.read_text().splitlines()) == 16
