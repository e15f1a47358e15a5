"""When the UI loop shows what has changed."""

import itertools
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import pytest

from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import actions as m
from nerfnav_app.state.job import Job, JobKind
from nerfnav_app.state.session import Session
from nerfnav_app.ui_loop import UiLoop
from nerfnav_app.worker.backend import NavigationBackend
from nerfnav_app.worker.worker import Worker
from tests.app.doubles import flight_step
from tests.waiting import PATIENCE_S, until


class Watcher:
    """A part of the page that notes when it was shown, and whether that was inside a block."""

    def __init__(self) -> None:
        self.shown: list[tuple[float, Session, bool]] = []
        self.inside = False

    def show(self, session: Session) -> None:
        self.shown.append((time.monotonic(), session, self.inside))

    @contextmanager
    def together(self) -> Iterator[None]:
        self.inside = True
        yield
        self.inside = False


def flying(session: Session, pace: float) -> Session:
    """The session with a flight under way."""
    begun = reduce(session, m.StartFlight())
    assert begun.job is not None and begun.job.kind is JobKind.FLY
    return replace(begun, job=replace(begun.job, pace=pace))


def told(job: Job, loop: UiLoop, seconds: float) -> None:
    """Let a flight report a step every few milliseconds."""
    end, k = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        loop.post(m.Reported(job.id, flight_step(job.ends, min(k, 8))))
        k += 1
        time.sleep(0.004)


@pytest.mark.parametrize(("pace", "frame_s"), [(0.0, 0.1), (1.0, 0.05)])
def test_a_flight_at_full_speed_is_shown_half_as_often(opened: Session, pace: float, frame_s: float) -> None:
    session = flying(opened, pace)
    loop, watcher = UiLoop(session), Watcher()
    loop.start((watcher,), watcher.together)
    assert session.job is not None
    told(session.job, loop, 1.0)
    loop.stop()
    times = [time for time, _, _ in watcher.shown]
    assert len(times) > 2 and min(later - before for before, later in itertools.pairwise(times)) >= frame_s - 1e-3
    assert all(inside for _, _, inside in watcher.shown)


def test_a_query_is_asked_again_where_the_session_drops_its_answer_and_not_where_it_takes_it_or_fails(
    opened: Session,
) -> None:
    @dataclass(frozen=True)
    class Answered:
        """Query with an answer that is taken, dropped or broken."""

        fate: str

        def apply(self, session: Session, result: object) -> Session:
            if self.fate == "broken":
                raise ValueError("it is broken")
            return session if self.fate == "dropped" else replace(session, results={self.fate: (self, result)})

    asked: list[object] = []
    loop = UiLoop(opened, lambda session: asked.append("followed"), ask_again=asked.append)
    loop.start(())
    for fate in ("dropped", "taken", "broken"):
        loop.post(m.QueryAnswered(Answered(fate), None))
    until(lambda: asked.count("followed") == 3, "the messages are not taken")
    loop.stop()
    assert asked == [Answered("dropped"), "followed", "followed", "followed"]


def test_a_command_does_not_wait_for_the_frame_of_a_flight(opened: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nerfnav_app.ui_loop._HURRYING_S", 3600.0)
    session = flying(opened, 0.0)
    loop, watcher = UiLoop(session), Watcher()
    loop.start((watcher,))
    assert session.job is not None
    told(session.job, loop, 0.3)
    assert len(watcher.shown) == 1
    loop.post(m.Pause())
    end = time.monotonic() + PATIENCE_S
    while len(watcher.shown) == 1 and time.monotonic() < end:
        time.sleep(0.001)
    loop.stop()
    paused = watcher.shown[1][1]
    assert paused.job is not None and paused.job.paused and paused.flight is not None and paused.flight.steps


class Slow(Watcher):
    """A part of the page that shows until it is released."""

    def __init__(self) -> None:
        super().__init__()
        self.began, self.released = threading.Event(), threading.Event()

    def show(self, session: Session) -> None:
        super().show(session)
        self.began.set()
        self.released.wait(PATIENCE_S)


def test_no_part_is_shown_once_the_loop_was_stopped(opened: Session) -> None:
    """A server that is stopped while the page is being shown has no event loop for the parts that are left."""
    loop, slow, watcher = UiLoop(opened), Slow(), Watcher()
    loop.start((slow, watcher))
    assert slow.began.wait(PATIENCE_S)
    stopping = threading.Thread(target=loop.stop)
    stopping.start()
    assert loop.stopping.wait(PATIENCE_S)
    slow.released.set()
    stopping.join(PATIENCE_S)
    assert not stopping.is_alive() and len(slow.shown) == 1 and not watcher.shown


def test_an_app_that_was_interrupted_before_its_threads_began_can_be_stopped(opened: Session) -> None:
    UiLoop(opened).stop()
    Worker(NavigationBackend(), lambda _: None).stop()


def test_what_moves_by_itself_moves_in_real_time_however_long_it_takes_to_show(opened: Session) -> None:
    class Slow(Watcher):
        def show(self, session: Session) -> None:
            time.sleep(0.2)
            super().show(session)

    loop, watcher = UiLoop(replace(opened, motion_time=0.0)), Slow()
    loop.start((watcher,))
    end = time.monotonic() + PATIENCE_S
    while len(watcher.shown) < 8 and time.monotonic() < end:
        time.sleep(0.01)
    loop.stop()
    (first, _, _), (last, session, _) = watcher.shown[0], watcher.shown[7]
    assert session.motion_time is not None and 0.5 * (last - first) < session.motion_time < 1.01 * (last - first)
