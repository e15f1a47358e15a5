"""What is written while a robot flies can be read whatever happens."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.navigation.episode import Episode, NavigationStep
from nerfnav.navigation.supervisor import StateChange, SupervisorAction, SupervisorState
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle
from nerfnav.planner import Movers
from nerfnav_app.storage import step_log as log_module
from nerfnav_app.storage.output_files import OutputError
from nerfnav_app.storage.run_metadata import RunMetadata
from nerfnav_app.storage.run_store import RunStore
from nerfnav_app.storage.step_log import StepLog, count_steps, is_locked, open_step_log, read_steps
from tests.app.storage.stored_runs import about, put
from tests.export.flights import arrived, curve, flown


def written(folder: Path, count: int | None = None) -> tuple[NavigationStep, ...]:
    """A log of the first steps of a flight; returns them."""
    steps = flown(size=24)[:count]
    with open_step_log(folder, about(), Episode.metrics) as log:
        assert log is not None
        for step in steps:
            log.append(step)
    return steps


def test_a_flight_reads_back_bit_for_bit_but_for_its_pictures(tmp_path: Path) -> None:
    steps = written(tmp_path)
    for step, back in zip(steps, read_steps(tmp_path), strict=True):
        assert (back.index, back.time, back.touched, back.outcome) == (
            step.index, step.time, step.touched, step.outcome
        )  # fmt: skip
        for part in ("position", "velocity", "rotation", "body_rate"):
            for one, other in (
                (step.truth, back.truth), (step.belief.mean, back.belief.mean), (step.plan.states, back.plan.states)
            ):  # fmt: skip
                assert torch.equal(getattr(one, part), getattr(other, part))
        assert torch.equal(step.belief.covariance, back.belief.covariance)
        assert torch.equal(step.plan.actions, back.plan.actions) and back.plan.dt == step.plan.dt
        assert (step.action is None) == (back.action is None)
        assert (step.image is None) == (back.image is None)
        if step.image is not None and back.image is not None:
            np.testing.assert_allclose(back.image, step.image, atol=3)
    assert Episode.of(read_steps(tmp_path)).metrics() == Episode.of(steps).metrics()


def test_the_first_plan_reads_back_bit_for_bit_and_logs_without_one_still_load(tmp_path: Path) -> None:
    motion, shelf = curve(), RunStore(tmp_path)
    first, *others = read_steps(put(shelf, "new", arrived(motion)))
    assert first.first_plan is not None and first.first_plan.dt == motion.dt
    for name in ("position", "velocity", "rotation", "body_rate"):
        assert torch.equal(getattr(first.first_plan.states, name), getattr(motion.states, name))
    assert torch.equal(first.first_plan.actions, motion.actions)
    assert all(step.first_plan is None for step in others)
    assert "first_plan" not in (put(shelf, "old") / log_module.FILE).read_text()
    assert read_steps(shelf.path("old"))[0].first_plan is None


def test_recoveries_are_kept(tmp_path: Path) -> None:
    steps = [NavigationStep(**{**vars(step), "recovery": SupervisorAction.WIDENED}) for step in flown()[:3]]
    with open_step_log(tmp_path, about(), Episode.metrics) as log:
        assert log is not None
        for step in steps:
            log.append(step)
    assert [step.recovery for step in read_steps(tmp_path)] == [SupervisorAction.WIDENED] * 3


def test_changes_of_the_supervisors_state_are_kept_with_their_reasons(tmp_path: Path) -> None:
    change = StateChange(1, SupervisorState.TRACKING, SupervisorState.SEARCHING, "pictures disagree: 1")
    with open_step_log(tmp_path, about(), Episode.metrics) as log:
        assert log is not None
        for step in flown()[:3]:
            log.append(NavigationStep(**{**vars(step), "change": change if step.index == 1 else None}))
    assert [step.change for step in read_steps(tmp_path)] == [None, change, None]


def test_gusts_are_kept_and_steps_without_one_say_nothing_of_them(tmp_path: Path) -> None:
    gusts = (None, 0.125, 0.0)
    with open_step_log(tmp_path, about(), Episode.metrics) as log:
        assert log is not None
        for step, gust in zip(flown()[:3], gusts, strict=True):
            log.append(NavigationStep(**{**vars(step), "gust_mps": gust}))
    assert tuple(step.gust_mps for step in read_steps(tmp_path)) == gusts
    lines = (tmp_path / "steps.jsonl").read_text().splitlines()
    assert ["gust_mps" in line for line in lines] == [False, True, True]


def test_boxes_of_seen_movers_are_kept_where_they_are_at_each_time(tmp_path: Path) -> None:
    shape, motion = BoxShape((0.1, 0.2, 0.3)), ConstantVelocity((0.5, 0.0, -0.1))
    boxes = Movers(tuple(Obstacle(f"seen 1 {n + 1}", shape, (n, 0.1, 0.2), (0.0, 0.3, n), motion) for n in range(2)))
    with open_step_log(tmp_path, about(), Episode.metrics) as log:
        assert log is not None
        for step in flown()[:3]:
            log.append(NavigationStep(**{**vars(step), "kept_movers": boxes if step.index == 1 else None}))
    before, during, after = (step.seen_movers for step in read_steps(tmp_path))
    assert before is None and after is None and during is not None
    for kept, seen in zip(during.obstacles, boxes.obstacles, strict=True):
        parts = [(box.position, box.rotation, box.shape, box.motion) for box in (kept, seen)]
        assert parts[0] == parts[1]


def test_each_step_is_on_disk_before_the_next_one_begins(tmp_path: Path) -> None:
    log = StepLog(tmp_path, about(), Episode.metrics)
    for count, step in enumerate(flown()[:4]):
        log.append(step)
        assert len(read_steps(tmp_path)) == count + 1 and count_steps(tmp_path) == count
        assert RunMetadata.load(tmp_path).outcome is None
    log.close()
    assert RunMetadata.load(tmp_path).outcome == "stopped"


@pytest.mark.parametrize("cut", [1, 40, 2000])
def test_a_last_line_that_is_cut_off_counts_as_not_written(tmp_path: Path, cut: int) -> None:
    steps = written(tmp_path)
    path = tmp_path / log_module.FILE
    path.write_bytes(path.read_bytes()[:-cut])
    assert len(read_steps(tmp_path)) == len(steps) - 1


def test_a_picture_that_is_cut_off_is_left_out(tmp_path: Path) -> None:
    written(tmp_path)
    picture = tmp_path / log_module.PICTURES / "00002.jpg"
    picture.write_bytes(picture.read_bytes()[:20])
    steps = read_steps(tmp_path)
    assert steps[2].image is None and steps[3].image is not None


@pytest.mark.parametrize("content", ["", "{}\n", "nonsense\n", json.dumps({"index": 0}) + "\n", "[1]\n"])
def test_what_is_no_log_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / log_module.FILE).write_text(content)
    with pytest.raises(InvalidInputError, match=r"damaged|cut off before its first step"):
        read_steps(tmp_path)


def test_a_log_that_is_missing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="no readable log"):
        read_steps(tmp_path / "nowhere")
    assert count_steps(tmp_path / "nowhere") == 0


def test_a_flight_that_never_left_the_start_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    written(tmp_path / "run", 1)
    assert not (tmp_path / "run").exists()


def test_a_new_flight_replaces_the_one_that_was_in_its_folder(tmp_path: Path) -> None:
    written(tmp_path)
    written(tmp_path, 4)
    assert len(read_steps(tmp_path)) == 4
    assert len(list((tmp_path / log_module.PICTURES).iterdir())) == 3


def test_two_flights_cannot_be_written_into_one_folder(tmp_path: Path) -> None:
    log = StepLog(tmp_path, about(), Episode.metrics)
    log.append(flown()[0])
    assert is_locked(tmp_path / log_module.FILE)
    with pytest.raises(OutputError, match="another flight is being written"):
        StepLog(tmp_path, about(), Episode.metrics)
    assert len(read_steps(tmp_path)) == 1, "the first flight must not suffer"
    log.close()


def test_an_error_on_the_way_keeps_what_was_flown(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), open_step_log(tmp_path, about(), Episode.metrics) as log:
        assert log is not None
        for step in flown()[:5]:
            log.append(step)
        raise RuntimeError("the motor has stopped")
    assert len(read_steps(tmp_path)) == 5 and RunMetadata.load(tmp_path).outcome == "stopped"
    assert not is_locked(tmp_path / log_module.FILE)


def test_what_is_known_of_a_flight_reads_back(tmp_path: Path) -> None:
    said = {"command": "nerfnav fly balls", "requests": ("a gust",), "plan_outcome": "converged"}
    known = about(task="through the gap", open_loop=True, **said, outcome="reached", metrics={"steps": 3})
    known.save(tmp_path)
    assert RunMetadata.load(tmp_path) == known


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"format": "nerfnav run", "version": 99}'])
def test_an_unreadable_record_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "run.json").write_text(content)
    with pytest.raises(InvalidInputError, match="no readable nerfnav run"):
        RunMetadata.load(tmp_path)


def test_a_full_disk_is_told_without_saying_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "run").mkdir()
    log = StepLog(tmp_path / "run", about(), Episode.metrics)

    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(log_module, "keep_picture", refuse)
    with pytest.raises(OutputError, match="cannot be written into run: No space left on device"):
        log.append(flown()[1])
    log.close()


@pytest.mark.parametrize(
    ("place", "value", "reason"),
    [
        (("truth", 3), math.inf, r"truth\[3\] is inf"),
        (("plan", "actions", 2), math.nan, r"plan\.actions\[2\] is nan"),
        (("time",), 1e300, r"time\[0\] is 1e\+300"),
        (("plan", "dt"), 0, "a dt of 0"),
        (("index",), 7, "line 3 is no step 2"),
        (("outcome",), 5, r"\$\.outcome"),
        (("belief",), {}, r"\$\.belief"),
        (("action",), [1.0], "line 3 is no step 2 with an action"),
        (("seen",), [[0.0] * 11], "damaged"),
        (("seen",), [[*[0.0] * 6, 1.0, -1.0, 1.0, *[0.0] * 3]], "edge of a box along y"),
        (("seen",), [[math.nan, *[0.0] * 5, *[1.0] * 6]], r"seen\[0\]\[0\] is nan"),
    ],
)
def test_a_damaged_step_is_refused_with_its_place(
    place: tuple[str | int, ...], value: object, reason: str, tmp_path: Path
) -> None:
    written(tmp_path)
    lines = (tmp_path / log_module.FILE).read_text().splitlines(keepends=True)
    said = part = json.loads(lines[2])
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    (tmp_path / log_module.FILE).write_text("".join([*lines[:2], json.dumps(said) + "\n", *lines[3:]]))
    with pytest.raises(InvalidInputError, match=reason):
        read_steps(tmp_path)


@pytest.mark.parametrize(
    ("key", "value"), [("dt", math.nan), ("robot", 5), ("ends", []), ("metrics", None), ("requests", [1])]
)
def test_damaged_metadata_are_refused(key: str, value: object, tmp_path: Path) -> None:
    about().save(tmp_path)
    said = json.loads((tmp_path / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps(said | {key: value}))
    with pytest.raises(InvalidInputError, match=r"run\.json of .* is no readable nerfnav run"):
        RunMetadata.load(tmp_path)
