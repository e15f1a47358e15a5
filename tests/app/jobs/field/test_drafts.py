"""A capture becomes a draft to plan in at once, which is trained on while nothing else runs."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.checkpoint import load_field
from nerfnav.field.train.grid_learner import GridLearner
from nerfnav.field.train.progress import TrainStep
from nerfnav_app.jobs.events import Progress, SurfaceShaped
from nerfnav_app.jobs.field import captures, drafts, train
from nerfnav_app.jobs.open import make_field
from nerfnav_app.jobs.open.opening import run
from nerfnav_app.page.panels.place.place import picture_of_training
from nerfnav_app.places.sources import BUDGETS_S
from nerfnav_app.places.surface_glb import read_box
from nerfnav_app.queries.better_field import BetterFieldQuery
from nerfnav_app.queries.query import Resources
from nerfnav_app.state import actions as m
from nerfnav_app.state.session import Session
from tests.app.following import result_of
from tests.app.sessions import after, reports
from tests.clock import Clock
from tests.importers.captures.synthetic import write_transforms
from tests.importers.captures.test_depths import write_depths


@pytest.fixture(autouse=True)
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(captures, "NODES", 4000)
    monkeypatch.setattr(train, "OUTSIDE_NODES", 32)
    for quality in BUDGETS_S:
        monkeypatch.setitem(BUDGETS_S, quality, 0.3)


def test_depth_is_fused_and_not_learned_from_at_first(tmp_path: Path) -> None:
    out = tmp_path / "room.npz"
    events = list(make_field.run(write_depths(tmp_path / "room"), out))
    assert [event.label for event in events if isinstance(event, Progress)][-1] == "fusing the depth maps"
    fused = load_field(out)
    assert isinstance(fused, VoxelField) and fused.unknown is not None
    assert (fused.info.made_by, fused.info.iterations, fused.info.proven_from) == ("fused", 0, "depth")
    assert fused.info.noise_std is not None and fused.info.images == 7
    assert fused.density(fused.box.lower.new_zeros(1, 3)).item() < 1, "the middle of the sphere is free"


def test_pictures_alone_give_a_short_training(tmp_path: Path) -> None:
    room, out = write_transforms(tmp_path / "room"), tmp_path / "room.npz"
    result_of(make_field.run(room, out))
    draft = load_field(out)
    assert draft.info.made_by == "draft" and draft.info.iterations > 0
    result_of(make_field.run(room, out, "draft"))
    assert load_field(out).info.made_by == "trained", "a draft that was asked for stays"


@pytest.mark.parametrize("write", [write_depths, write_transforms])
def test_cameras_and_points_are_shown_before_the_draft(write: Callable[[Path], Path], tmp_path: Path) -> None:
    shown = list(make_field.run(write(tmp_path / "room"), tmp_path / "room.npz"))
    kinds = [type(event) for event in shown if isinstance(event, SurfaceShaped | TrainStep)]
    assert kinds[0] is SurfaceShaped
    (surface,) = (event for event in shown if isinstance(event, SurfaceShaped))
    box = load_field(tmp_path / "room.npz").box
    assert surface.rough and read_box(surface.glb) == (box.lower.tolist(), box.upper.tolist())


def test_pictures_of_the_training_are_shown_while_a_draft_is_made(tmp_path: Path) -> None:
    session = Session.opening(str(write_transforms(tmp_path / "room")))
    assert picture_of_training(session) is None
    seen = []
    for event in run(session.what):
        session = reports(session, event)
        if isinstance(event, TrainStep) and event.picture is not None:
            seen.append(picture_of_training(session))
            assert seen[-1] is event.picture
        if session.place is not None:
            break
    assert seen and picture_of_training(session) is None, "what has opened is shown itself"


def test_what_compiles_is_not_in_the_budget_of_a_draft_and_the_time_left_is_that_of_the_budget(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, steps, told = Clock(monkeypatch), itertools.count(), []
    monkeypatch.setitem(BUDGETS_S, "draft", 40.0)
    clock.slow(GridLearner, "step", lambda *_: 1.0 if next(steps) else 60.0)
    for event in make_field.run(write_transforms(tmp_path / "room"), tmp_path / "room.npz"):
        if isinstance(event, Progress) and event.left_s is not None:
            told.append((clock.now, event.left_s))
    assert load_field(tmp_path / "room.npz").info.iterations > 20, "the first step was not in the budget"
    ends = [now + left for now, left in told]
    assert len(told) > 10 and max(ends) - min(ends) < 1e-6 and told[0][1] > 35


def opened(source: Path) -> Session:
    """A session in which a capture was opened, without what follows its surface."""
    session = Session.opening(str(source))
    for event in run(session.what):
        session = reports(session, event)
        if isinstance(event, SurfaceShaped) and session.place is not None:
            return replace(session, seeking=False, surface_is_rough=False)
    raise AssertionError("nothing was opened")


@pytest.mark.slow
@pytest.mark.parametrize("write", [write_depths, write_transforms])
def test_a_draft_is_replaced_by_a_trained_field_between_plans(
    write: Callable[[Path], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(BUDGETS_S, "good", 3.0)  # more than it takes to read the capture beside other processes
    session = opened(write(tmp_path / "room"))
    ends, steps, left, pictures = session.ends, 0, [], []
    assert not list(BetterFieldQuery.pending(replace(session, surface_is_rough=True))), "the texture comes first"
    while pending := list(BetterFieldQuery.pending(session)):
        (query,) = pending
        assert session.place is not None
        if query.refinement is not None and query.refinement.left_s is not None:
            left.append(query.refinement.left_s)
        pictures.append(picture_of_training(session))
        session = after(session, m.QueryAnswered(query, query.answer(Resources(session.place))))
        steps += 1
    place = session.place
    assert place is not None and place.file is not None and steps > 3
    assert place.field.info.made_by == "trained" and place.field.info.iterations > 0
    assert load_field(place.file).info.created == place.field.info.created
    assert session.ends == ends and session.surface_is_rough
    assert pictures[-1] is not None and picture_of_training(session) is None, "shown while it is trained"
    assert left and left == sorted(left, reverse=True), "the time left runs down"
    assert "all pictures of the capture" in session.notices[-1].body


def test_plans_come_before_the_trained_field(tmp_path: Path) -> None:
    session = opened(write_depths(tmp_path / "room"))
    assert not list(BetterFieldQuery.pending(after(session, m.StartPlan())))


def test_a_draft_without_its_capture_stays(tmp_path: Path) -> None:
    session = opened(write_depths(tmp_path / "room"))
    assert session.place is not None and session.place.file is not None
    assert list(BetterFieldQuery.pending(session))
    alone = replace(session, what=str(session.place.file))
    moved = replace(session, place=replace(session.place, file=tmp_path / "other" / "room.npz"))
    assert not list(BetterFieldQuery.pending(alone)) and not list(BetterFieldQuery.pending(moved))


def test_a_budget_runs_while_steps_are_computed_and_not_between_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, seconds = Clock(monkeypatch), 100.0
    clock.slow(train, "gather", lambda *_: 10.0)
    clock.slow(GridLearner, "step", lambda *_: 1.0)
    for _ in drafts.refine(write_depths(tmp_path / "room"), tmp_path / "room.npz", "good", seconds):
        clock.now += 50.0
    field = load_field(tmp_path / "room.npz")
    assert 50 < field.info.iterations < 100 and clock.now > 10 * seconds
