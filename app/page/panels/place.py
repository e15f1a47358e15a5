"""Which place is open, and what moves in it."""

from collections.abc import Callable

import viser

import scenes
from app.page.html import note
from app.page.panels.dropdown import ChoiceList
from app.places.derived import unproven_of
from app.places.sources import SUFFIXES, title_of
from app.places.uploads import UploadError, Uploads
from app.state.actions import Cancel, Command, OpenPlace, Tell
from app.state.session import Session
from nerfnav import robots


class PlacePanel:
    """A list of the bundled places, and of the robots."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None], uploads: Uploads) -> None:
        """`post` takes what the user asks, `uploads` what the user brings."""
        self._post, self._uploads = post, uploads
        self._session: Session | None = None
        self._known: dict[str, str] = {}
        self._places: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
            "Place", list[str](scenes.names()), hint="Bundled worlds, and the file that was opened"
        )
        self._places.on_update(self._open)
        self._upload = server.gui.add_upload_button(
            "Open a file",
            color="gray",
            icon=viser.Icon.UPLOAD,
            mime_type=",".join(SUFFIXES),
            hint="A field, a mesh (glb, obj, ...), Gaussian splats (ply, spz, sog, ...), a capture in a zip, a video",
        )
        self._upload.on_upload(self._take)
        self._stop = server.gui.add_button("Stop opening", color="gray", icon=viser.Icon.X, visible=False)
        self._unproven = server.gui.add_html("", visible=False)
        self._robots = ChoiceList(server, "robot", robots.names(), "What moves: its body and its dynamics", post)

        @self._stop.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(Cancel())

    async def _open(self, event: viser.GuiEvent) -> None:
        what = self._known.get(self._places.value)  # nothing is known before the first session is shown
        if event.client is not None and self._session is not None and what not in (None, self._session.what):
            self._post(OpenPlace(what))

    def _take(self, event: viser.GuiEvent) -> None:
        """Keep what was brought and open it; runs on a thread of the server's pool."""
        brought = self._upload.value
        try:
            self._post(OpenPlace(str(self._uploads.keep(brought.name, brought.content))))
        except UploadError as error:
            self._post(Tell("Not opened", str(error), bad=True))

    def show(self, session: Session) -> None:
        """Show what is open and chosen."""
        self._session = session
        self._known |= {title_of(what): what for what in (*scenes.names(), session.what)}
        if self._places.options != tuple(self._known):
            self._places.options = tuple(self._known)
        self._places.value = title_of(session.what)
        self._stop.visible = session.place is None and session.before is not None
        told = "" if session.place is None else unproven_of(session.place)
        self._unproven.visible = told != ""
        if told:
            self._unproven.content = note(told)
        self._robots.show(session)
