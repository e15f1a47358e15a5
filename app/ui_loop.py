"""The UI loop: the one thread that changes the session and shows it.

commands of tabs and reports of the worker --> inbox --> session = reduce(session, message) --> parts of the page
"""

import logging
import queue
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any, Protocol

from nerfnav_app.reducers.root import reduce
from nerfnav_app.state.actions import Action, MoveEnd, QueryAnswered, Reported, Tick
from nerfnav_app.state.obstacles import ChangeObstacle
from nerfnav_app.state.session import Session

_log = logging.getLogger(__name__)
_FRAME_S = 1 / 20  # the page changes at most this often; what happens in between is merged
_HURRYING_S = 1 / 10  # the same for what a flight at full speed tells: each frame takes time from its next step
_SETTLED_S = 1 / 200  # what comes together is shown together


class Shows(Protocol):
    """A part of the page."""

    def show(self, session: Session) -> None:
        """Show the session, by changing what has changed."""
        ...


class UiLoop:
    """Takes messages from any thread, and moves one session on."""

    def __init__(
        self, session: Session, *follow: Callable[[Session], None], ask_again: Callable[[Any], None] = lambda _: None
    ) -> None:
        """All of `follow` are called with every new session, `ask_again` with each query whose answer is dropped."""
        self.session = session
        self.parts: tuple[Shows, ...] = ()
        """What shows the session."""
        self._together: Callable[[], AbstractContextManager[None]] = nullcontext
        self._follow, self._ask_again = follow, ask_again
        self._inbox: queue.SimpleQueue[Action | None] = queue.SimpleQueue()
        self.stopping = threading.Event()
        """Set once `stop` was called."""
        self._ticked_at: float | None = None
        self._thread = threading.Thread(target=self._run, name="nerfnav-ui", daemon=True)

    def start(
        self, parts: tuple[Shows, ...], together: Callable[[], AbstractContextManager[None]] = nullcontext
    ) -> None:
        """Begin to take messages, and to show the session in these parts of the page.

        What they change inside one block of `together` reaches the page at once.
        """
        self.parts, self._together = parts, together
        self._thread.start()

    def post(self, message: Action) -> None:
        """Hand a message to the session, from any thread."""
        self._inbox.put(message)

    def stop(self) -> None:
        """Take no more messages, and show no more parts: the server may be stopped then.

        Nothing happens where the loop was not started.
        """
        self.stopping.set()
        self._inbox.put(None)
        if self._thread.ident is not None:
            self._thread.join(5)

    def call_on_loop(self, wait_s: float) -> bool:
        """Wait, and return whether messages are still taken."""
        self._thread.join(wait_s)
        return self._thread.is_alive()

    def _run(self) -> None:
        """Take in messages as they come, and show what they made of the session at once, but not too often."""
        self._show()
        shown_at = time.monotonic()
        while (message := self._next()) is not None:
            changed = self._take(message)
            until = self._due(message, shown_at)
            while (left := until - time.monotonic()) > 0:
                try:
                    message = self._inbox.get(timeout=left)
                except queue.Empty:
                    break
                if message is None:
                    return
                changed = self._take(message) or changed
                until = min(until, self._due(message, shown_at))
            if changed:
                self._show()
                shown_at = time.monotonic()

    def _due(self, message: Action, shown_at: float) -> float:
        """When to show what a message has changed, after the page was shown at `shown_at` [s]."""
        frame, job = _FRAME_S, self.session.job
        if self.session.held:  # the worker makes no more plans a second than the hand makes moves: none has to wait
            frame = 0.0
        elif job is not None and job.runs_unpaced and isinstance(message, Reported | QueryAnswered):
            frame = _HURRYING_S
        return max(shown_at + frame, time.monotonic() + _SETTLED_S)

    def _next(self) -> Action | None:
        """The next message, or the time that has passed where something moves by itself: in real time, however long the
        page took to be shown."""
        moves, now = self.session.moves, time.monotonic()
        if not moves or self._ticked_at is None:
            self._ticked_at = now if moves else None
        wait = None if self._ticked_at is None else max(0.0, self._ticked_at + _FRAME_S - now)
        try:
            return self._inbox.get(timeout=wait)
        except queue.Empty:
            assert self._ticked_at is not None, "only what moves by itself waits for a frame"
            before, self._ticked_at = self._ticked_at, time.monotonic()
            return Tick(self._ticked_at - before)

    def _take(self, message: Action) -> bool:
        """Let the session move on; whether the page may have to change."""
        before = self.session
        try:
            self.session = reduce(before, message)
        except Exception:
            _log.exception("a message of type %s was not understood", type(message).__name__)
        else:
            if isinstance(message, QueryAnswered) and self.session is before:
                self._ask_again(message.query)
        for follow in self._follow:
            follow(self.session)
        if isinstance(message, MoveEnd | ChangeObstacle) and message.held and self.session.plan_follows_hand:
            return False  # the hand has moved the gizmo itself: what is worth a frame is the plan that follows
        # a command that was refused leaves the session alone, but its tab shows what was refused
        return self.session is not before or not isinstance(message, Reported)

    def _show(self) -> None:
        with self._together():
            for part in self.parts:
                if self.stopping.is_set():
                    return
                try:
                    part.show(self.session)
                except Exception:
                    _log.exception("%s could not show the session", type(part).__name__)
