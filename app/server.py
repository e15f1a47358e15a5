"""The browser app: a page that shows one session, and the two threads behind it.

tabs --commands--> inbox --> UI loop: session = reduce(session, message) --> layers and panels --> tabs
                     ^            | session
                     +-- events --+--> worker: the job that the session wants
"""

import logging
import queue
import threading
import time
from typing import Protocol

from app.page.icon_archive import icons_at_hand
from app.page.layers.comparison import ComparisonLayer
from app.page.layers.ends import EndsLayer
from app.page.layers.field_backdrop import FieldBackdropLayer
from app.page.layers.field_surface import FieldSurfaceLayer
from app.page.layers.flight import FlightLayer
from app.page.layers.notices import NoticesLayer
from app.page.layers.overlays import OverlaysLayer
from app.page.layers.placing import PlacingLayer
from app.page.layers.plan import PlanLayer
from app.page.layers.search import SearchLayer
from app.page.layers.splats import SplatsLayer
from app.page.panels.panel import Page
from app.page.panels.tabs import panels
from app.page.theme import apply_theme
from app.page_server import page_server
from app.places.uploads import Uploads
from app.reducers.root import reduce
from app.security.address import check_address, page_url
from app.state.actions import Action, Reported, Tick
from app.state.session import Session
from app.system.threads import TORCH_THREADS
from app.worker.backend import NavigationBackend
from app.worker.worker import Work, Worker
from nerfnav.errors import NerfnavError

_log = logging.getLogger(__name__)
_FRAME_S = 1 / 20  # the page changes at most this often; what happens in between is merged
_SETTLED_S = 1 / 200  # what comes together is shown together


class Shows(Protocol):
    """A part of the page."""

    def show(self, session: Session) -> None:
        """Show the session, by changing what has changed."""
        ...


class App:
    """One place, served to any number of tabs."""

    def __init__(
        self,
        what: str,
        host: str = "127.0.0.1",
        port: int = 8080,
        token: str | None = None,
        work: Work | None = None,
        begun: FieldSurfaceLayer | None = None,
    ) -> None:
        """Nothing is listened at before `start`; with `begun`, its server is used, which whoever gives it stops."""
        self._host, self._port, self._token = host, port, token
        self._session = Session.opening(what, surface=None if begun is None else begun.surface)
        self._inbox: queue.SimpleQueue[Action | None] = queue.SimpleQueue()
        self._worker = Worker(work or NavigationBackend(), self.post, TORCH_THREADS)
        self._loop = threading.Thread(target=self._run, name="nerfnav-ui", daemon=True)
        self._begun, self._server = begun, None if begun is None else begun.server
        self._parts: tuple[Shows, ...] = ()
        self._uploads = Uploads()

    @property
    def session(self) -> Session:
        """The state as of now."""
        return self._session

    @property
    def url(self) -> str:
        """Where the page is, token included."""
        return page_url(self._host, self._port, self._token)

    def start(self) -> None:
        """Listen, put up the page, and begin to open the place."""
        if self._begun is None:
            check_address(self._host, self._port)
        scene = self._begun or FieldSurfaceLayer(page_server(self._host, self._port, self._token))
        self._server = server = scene.server
        self._worker.follow(self._session)  # opens the place while the page is being put up
        self._worker.start()
        server.gui.reset()  # a given one may have said that more is to come
        apply_theme(server)
        layers: tuple[Shows, ...] = (
            scene,
            SplatsLayer(server),
            OverlaysLayer(server),
            FieldBackdropLayer(server, self.post),
            EndsLayer(server, self.post),
            PlanLayer(server),
            FlightLayer(server),
            ComparisonLayer(server),
            SearchLayer(server),
            PlacingLayer(server),
            NoticesLayer(server),
        )
        with icons_at_hand():
            self._parts = (*layers, *panels(Page(server, self.post, self._uploads)))
        self._loop.start()

    def stop(self) -> None:
        """End the worker and the page."""
        self._inbox.put(None)
        self._loop.join(5)
        self._worker.stop()
        if self._server is not None and self._begun is None:
            self._server.stop()
        self._uploads.close()

    def post(self, message: Action) -> None:
        """Hand a message to the session, from any thread."""
        self._inbox.put(message)

    def wait(self) -> None:
        """Return when the app was stopped; raise NerfnavError when the place could not be opened."""
        while self._loop.is_alive():
            self._loop.join(0.5)
            if self._session.job is None and self._session.place is None:
                raise NerfnavError(self._session.notices[-1].body)

    def _run(self) -> None:
        """Take in messages as they come, and show what they made of the session at once, but not too often."""
        self._show()
        shown_at = time.monotonic()
        while (message := self._next()) is not None:
            until = max(shown_at + _FRAME_S, time.monotonic() + _SETTLED_S)
            changed = self._take(message)
            while (left := until - time.monotonic()) > 0:
                try:
                    message = self._inbox.get(timeout=left)
                except queue.Empty:
                    break
                if message is None:
                    return
                changed = self._take(message) or changed
            if changed:
                self._show()
                shown_at = time.monotonic()

    def _next(self) -> Action | None:
        """The next message, or that a frame has passed where something moves by itself."""
        try:
            return self._inbox.get(timeout=_FRAME_S if self._session.moves else None)
        except queue.Empty:
            return Tick(_FRAME_S)

    def _take(self, message: Action) -> bool:
        """Let the session move on; whether the page may have to change."""
        before = self._session
        try:
            self._session = reduce(before, message)
        except Exception:
            _log.exception("a message of type %s was not understood", type(message).__name__)
        self._worker.follow(self._session)
        # a command that was refused leaves the session alone, but its tab shows what was refused
        return self._session is not before or not isinstance(message, Reported)

    def _show(self) -> None:
        for part in self._parts:
            try:
                part.show(self._session)
            except Exception:
                _log.exception("%s could not show the session", type(part).__name__)
