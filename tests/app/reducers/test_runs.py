"""Stored flights and the timeline in the session, without a browser and without a disk but for the store."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav.estimator.relocalize.global_localization import RelocaliseStep
from nerfnav.obstacles import format_obstacles
from nerfnav.robots.state import RigidState
from nerfnav_app.jobs.events import JobFinished, JobResult, PlaceOpened
from nerfnav_app.queries.catalog import pending_queries
from nerfnav_app.queries.placed_obstacles import PlacedObstaclesQuery
from nerfnav_app.queries.query import Resources
from nerfnav_app.queries.run_list import RunListQuery
from nerfnav_app.queries.stored_run import StoredRunQuery
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import actions as m
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.obstacles import ObstacleKind, new_obstacle
from nerfnav_app.state.runs import CompareRun, DeleteRun, ListRuns, OpenRun, PlayBack, RenameRun, Scrub
from nerfnav_app.state.session import Session
from nerfnav_app.storage.kept_obstacles import KEPT
from nerfnav_app.storage.run_store import RunStore
from nerfnav_app.worker.backend import NavigationBackend
from tests.app.doubles import balls_place, flight_step
from tests.app.storage.stored_runs import ENDS, put

_OF_RUNS = RunListQuery | StoredRunQuery


@pytest.fixture
def store(tmp_path: Path) -> RunStore:
    store = RunStore(tmp_path)
    put(store, "first", date="2026-01-01T00:00:00+00:00")
    put(store, "second", date="2026-01-02T00:00:00+00:00")
    return store


def served(session: Session, store: RunStore, *actions: m.Action) -> Session:
    """The session after actions, the worker having read and changed the stored runs after each of them."""
    backend = NavigationBackend(runs=store)
    for action in actions:
        session = reduce(session, action)
        for change in session.runs.changes:
            session = reduce(session, backend.change(change))
        while asked := [query for query in pending_queries(session) if isinstance(query, _OF_RUNS)]:
            assert session.place is not None
            session = reduce(session, m.QueryAnswered(asked[0], asked[0].answer(Resources(session.place, store))))
    return session


@pytest.fixture
def session(store: RunStore) -> Session:
    """A session in its place, which knows the store."""
    opening = Session.opening("balls")
    assert opening.job is not None
    job = opening.job.id
    return served(opening, store, m.Reported(job, PlaceOpened(balls_place())), m.Reported(job, JobFinished("open")))


def test_the_store_is_listed_once_the_place_is_open_and_again_after_each_job(session: Session, store: RunStore) -> None:
    assert [entry.name for entry in session.runs.entries] == ["second", "first"]
    put(store, "third", date="2026-01-03T00:00:00+00:00")
    flying = served(session, store, m.StartFlight())
    assert [entry.name for entry in flying.runs.entries] == ["third", "second", "first"]
    store.delete("third")
    landed = served(flying, store, m.Cancel())
    assert len(landed.runs.entries) == 2
    store.delete("second")
    assert len(served(landed, store, ListRuns()).runs.entries) == 1


def test_an_opened_flight_is_shown_whole_between_its_ends(session: Session, store: RunStore) -> None:
    opened = served(session, store, OpenRun("first"))
    assert opened.flight is not None and len(opened.flight.steps) == 17
    assert opened.ends == ENDS and not opened.flight_is_stale
    assert opened.flight.summary["outcome"] == "collided"
    shown = opened.shown_flight
    assert shown is not None and len(shown.steps) == 17


def test_an_opened_flight_does_not_show_what_was_found_in_another(session: Session, store: RunStore) -> None:
    finding = served(session, store, OpenRun("first"), Scrub(8), m.FindRobot())
    assert finding.job is not None
    pose = RigidState.stack([RigidState.at_rest((0.1, 0.2, 0.3))]).pose
    step = RelocaliseStep(1.0, pose, torch.ones(1), torch.zeros(1))
    end = JobFinished("localize", JobResult({"outcome": "found", "advice": "one place looks like the picture"}))
    found = served(finding, store, m.Reported(finding.job.id, step), m.Reported(finding.job.id, end))
    assert found.search is not None and found.search.at == 9
    assert served(found, store, OpenRun("second")).search is None


def test_the_timeline_shows_any_time_step_and_keeps_within_the_flight(session: Session, store: RunStore) -> None:
    opened = served(session, store, OpenRun("first"))
    for asked, at in ((5, 5), (16, 16), (99, 16), (-3, 0), (7.4, 7)):
        shown = reduce(opened, Scrub(asked)).shown_flight
        assert shown is not None and opened.flight is not None
        assert len(shown.steps) == at + 1
        assert shown.plan is opened.flight.steps[at].plan, "the plan of that time is shown"
        assert (shown.outcome is not None) == (at == 16)


def test_the_timeline_runs_as_fast_as_the_flight_did_and_stops_at_its_end(session: Session, store: RunStore) -> None:
    running = served(session, store, OpenRun("first"), PlayBack(True))
    assert running.moves
    later = reduce(running, m.Tick(0.35))
    assert later.runs.timeline.at == 3 and later.moves
    assert reduce(later, m.Tick(0.02)).shown_flight is later.shown_flight, "nothing new, nothing to draw"
    held = reduce(later, PlayBack(False))
    assert not held.moves and reduce(held, m.Tick(1.0)).runs.timeline.at == 3
    ended = reduce(reduce(held, PlayBack(True)), m.Tick(60.0))
    assert ended.runs.timeline.at == 16 and not ended.moves
    assert reduce(ended, PlayBack(True)).runs.timeline.at == 0, "what is at its end begins again"


def test_the_timeline_of_an_old_flight_does_not_cut_a_new_one(session: Session, store: RunStore) -> None:
    scrubbed = served(session, store, OpenRun("first"), Scrub(4))
    flying = served(scrubbed, store, m.StartFlight())
    assert flying.job is not None
    flying = reduce(flying, m.Reported(flying.job.id, flight_step(flying.ends, 0)))
    assert flying.shown_flight is flying.flight
    assert reduce(flying, Scrub(0)) == flying, "a flight under way is not scrubbed"
    assert reduce(reduce(scrubbed, PlayBack(True)), m.StartFlight()).flight is not None


def test_the_view_from_the_robot_follows_the_timeline(session: Session, store: RunStore) -> None:
    opened = served(session, store, OpenRun("first"))
    keys = set()
    for at in (3, 4):
        (query,) = [query for query in pending_queries(reduce(opened, Scrub(at))) if hasattr(query, "states")]
        keys.add(query.key)
        assert query.states[0] is opened.flight.steps[at].belief.mean  # type: ignore[union-attr]
    assert len(keys) == 2


def test_a_flight_cannot_be_opened_while_another_is_under_way(session: Session, store: RunStore) -> None:
    flying = served(session, store, m.StartFlight())
    refused = served(flying, store, OpenRun("first"))
    assert refused.flight is flying.flight and refused.notices[-1].bad


def test_a_flight_from_another_place_opens_that_place_first(session: Session, store: RunStore) -> None:
    put(store, "far away", place="pyramids")
    known = served(session, store, ListRuns())
    opening = served(known, store, OpenRun("far away"))
    assert opening.job is not None and opening.job.kind is JobKind.OPEN and opening.what == "pyramids"
    place = replace(balls_place(), name="pyramids")
    there = served(opening, store, m.Reported(opening.job.id, PlaceOpened(place)))
    assert there.flight is not None and there.ends == ENDS
    gone = reduce(opening, m.Cancel())
    assert gone.what == "balls" and not gone.runs.wanted


def test_a_flight_of_another_robot_brings_its_robot(session: Session, store: RunStore) -> None:
    put(store, "driven", robot="couch")
    opened = served(session, store, ListRuns(), OpenRun("driven"))
    assert opened.place is not None and opened.place.robot.name == opened.choice.robot == "couch"
    put(store, "odd", robot="balloon")
    refused = served(session, store, ListRuns(), OpenRun("odd"))
    assert refused.flight is None and "balloon" in refused.notices[-1].body


def test_a_second_flight_is_compared_until_that_is_ended(session: Session, store: RunStore) -> None:
    both = served(session, store, OpenRun("first"), CompareRun("second"))
    assert both.runs.compared is not None and both.runs.compared.entry.name == "second"
    assert both.runs.opened is not None and both.runs.opened.record is both.flight
    assert reduce(both, CompareRun(None)).runs.compared is None
    put(store, "far away", place="pyramids")
    refused = served(both, store, ListRuns(), CompareRun("far away"))
    assert refused.runs.compared is both.runs.compared
    told = "far away was flown in pyramids, and balls is open: choose second or first."
    assert refused.notices[-1].body == told and not refused.runs.wanted


def test_renaming_and_deleting_reach_the_store_and_what_is_shown(session: Session, store: RunStore) -> None:
    opened = served(session, store, OpenRun("first"), RenameRun("first", "best"))
    assert [entry.name for entry in store.entries()] == ["second", "best"]
    assert opened.runs.opened is not None and opened.runs.opened.entry.name == "best"
    gone = served(opened, store, DeleteRun("best"))
    assert [entry.name for entry in gone.runs.entries] == ["second"] and gone.runs.opened is None
    assert gone.flight is opened.flight, "what is in sight stays in sight"


@pytest.mark.parametrize(
    "command",
    [OpenRun("nothing"), OpenRun("../x"), CompareRun("nothing"), RenameRun("first", "../x"), RenameRun("x/y", "z"),
     RenameRun("first", "second"), DeleteRun(".."), DeleteRun("")],
)  # fmt: skip
def test_what_cannot_be_done_is_told_without_paths_and_changes_nothing(
    session: Session, store: RunStore, command: m.Command
) -> None:
    told = served(session, store, command)
    assert told.notices[-1].bad and str(store.folder) not in told.notices[-1].body
    assert told.flight is None and told.runs.entries == session.runs.entries and not told.runs.wanted
    assert [entry.name for entry in store.entries()] == ["second", "first"]


def test_a_flight_is_not_compared_with_itself(session: Session, store: RunStore) -> None:
    alone = served(session, store, OpenRun("first"), CompareRun("first"))
    assert alone.runs.compared is None and alone.notices[-1].title == "The same flight"
    just_flown = replace(alone, runs=replace(alone.runs, opened=None))
    assert served(just_flown, store, CompareRun("first")).runs.compared is None


def test_a_run_brings_its_obstacles_back_and_undo_those_of_the_page(session: Session, store: RunStore) -> None:
    box = new_obstacle(ObstacleKind.BOX, "box 1", 0.2, (0.1, 0.2, 0.3))
    (store.path("first") / KEPT).write_text(format_obstacles([box.with_way_point((0.5, 0.2, 0.3)).entry]))
    session = replace(session, obstacles=(box,), chosen="box 1")
    opened = served(session, store, OpenRun("first"))
    (moving,) = opened.obstacles
    assert moving.path is not None and opened.chosen is None and opened.flight_is_shown
    assert list(PlacedObstaclesQuery.pending(opened)), "they are not placed"
    assert served(opened, store, m.Undo()).obstacles == (box,)
    assert served(opened, store, OpenRun("second")).obstacles == (), "it was flown without any"
    (store.path("first") / KEPT).write_text("{")
    refused = served(session, store, OpenRun("first"))
    assert refused.obstacles == (box,) and refused.notices[-1].bad and str(store.folder) not in refused.notices[-1].body
