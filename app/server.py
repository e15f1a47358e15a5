"""The browser app: a page that shows one session, and the two threads behind it.

tabs --commands--> inbox --> UI loop: session = reduce(session, message) --> layers and panels --> tabs
                     ^            | session
                     +-- events --+--> worker: the job that the session wants
"""

from dataclasses import replace
from pathlib import Path

from nerfnav.core.errors import NerfnavError
from nerfnav_app.page.layers.field_surface import FieldSurfaceLayer
from nerfnav_app.page.page import build_page
from nerfnav_app.page_server import page_server
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.security.address import page_url
from nerfnav_app.state.actions import Action
from nerfnav_app.state.obstacles import read_placed
from nerfnav_app.state.session import Session
from nerfnav_app.ui_loop import UiLoop
from nerfnav_app.worker.backend import NavigationBackend
from nerfnav_app.worker.session_memory import SessionMemory
from nerfnav_app.worker.work import Work
from nerfnav_app.worker.worker import Worker


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
        remembers: bool = False,
        obstacles: Path | None = None,
    ) -> None:
        """Nothing is listened at before `start`; with `begun`, its server is used, which the caller stops.

        An app that `remembers` begins with the ends, settings and view with which the last one left the place, but with
        the `obstacles` of a file, if given. Raises InvalidInputError where that cannot be read.
        """
        self._host, self._port, self._token = host, port, token
        self._library = PlaceLibrary()
        memory = SessionMemory(self._library.folder / "left_off", what) if remembers else None
        session = Session.opening(
            what, surface=None if begun is None else begun.surface, saved=None if memory is None else memory.last()
        )
        if obstacles is not None:
            session = replace(session, obstacles=read_placed(obstacles))
        self._worker = Worker(work or NavigationBackend(), self.post)
        self._loop = UiLoop(
            session, self._worker.follow, *([] if memory is None else [memory.follow]), ask_again=self._worker.ask_again
        )
        self._begun, self._server = begun, None if begun is None else begun.server

    @property
    def session(self) -> Session:
        """The state as of now."""
        return self._loop.session

    @property
    def url(self) -> str:
        """URL of the page, token included."""
        return page_url(self._host, self._port, self._token)

    def start(self) -> None:
        """Listen, put up the page, and begin to open the place."""
        surface = self._begun or FieldSurfaceLayer(page_server(self._host, self._port, self._token))
        self._server = surface.server
        self._worker.follow(self.session)  # opens the place while the page is being put up
        self._worker.start()
        # all changes of a frame in one message: each would wake up viser's thread, which takes the interpreter's lock
        self._loop.start(build_page(surface, self.post, self._library), surface.server.atomic)

    def stop(self) -> None:
        """End the worker and the page."""
        self._loop.stop()
        self._worker.stop()
        if self._server is not None and self._begun is None:
            self._server.stop()
        self._library.close()

    def post(self, message: Action) -> None:
        """Hand a message to the session, from any thread."""
        self._loop.post(message)

    def wait(self) -> None:
        """Return when the app was stopped; raise NerfnavError when the place could not be opened."""
        while self._loop.call_on_loop(0.5):
            if self.session.job is None and self.session.place is None:
                raise NerfnavError(self.session.notices[-1].body)
