"""Track a camera: bring a video or pictures, watch where it was, take the trajectory away."""

from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from nerfnav.export import TRACK_FILES, texts_of_track
from nerfnav_app.page.html import note
from nerfnav_app.page.panels.track_words import describe
from nerfnav_app.places.track_sources import SUFFIXES, TrackSources
from nerfnav_app.places.uploads import UploadError
from nerfnav_app.state.actions import Command, Tell
from nerfnav_app.state.session import Session
from nerfnav_app.state.tracks import ForgetTrack, StartTrack


class TrackPanel:
    """What is tracked, what is known of its camera, and what became of it."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None], sources: TrackSources) -> None:
        """`post` takes what the user asks, `sources` keeps what the user brings."""
        self._post, self._sources = post, sources
        self._session: Session | None = None
        with server.gui.add_folder("Track a camera", expand_by_default=True):
            self._fov = server.gui.add_number(
                "Field of view [°]", 0.0, min=0.0, max=170.0, step=0.1,
                hint="Horizontal; 0: that of the camera that the place was photographed with, else 90",
            )  # fmt: skip
            self._fps = server.gui.add_number(
                "Pictures per second", 0.0, min=0.0, max=1000.0, step=0.1,
                hint="For pictures that tell no times; 0: as the video, or the pictures' names, say",
            )  # fmt: skip
            self._upload = server.gui.add_upload_button(
                "Track a video", color="gray", icon=viser.Icon.VIDEO, mime_type=",".join(SUFFIXES),
                hint="A video, or a zip of pictures, that was taken here: where was its camera?",
            )  # fmt: skip
            self._said = server.gui.add_html(note("Bring a video that was taken in this place."))
            self._takes = [server.gui.add_button(name, icon=viser.Icon.DOWNLOAD, visible=False) for name in TRACK_FILES]
            self._forget = server.gui.add_button(
                "Forget the track", color="gray", icon=viser.Icon.ERASER, visible=False
            )
        self._upload.on_upload(self._take)
        for name, button in zip(TRACK_FILES, self._takes, strict=True):
            button.on_click(partial(self._send, name))

        @self._forget.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(ForgetTrack())

    def _take(self, event: viser.GuiEvent[Any]) -> None:
        """Keep what was brought and track it; runs on a thread of the server's pool."""
        brought = self._upload.value
        fps, fov = float(self._fps.value), float(self._fov.value)
        try:
            source = self._sources.keep(brought.name, brought.content)
        except UploadError as error:
            self._post(Tell("Not tracked", str(error), bad=True))
            return
        self._post(StartTrack(source, brought.name, fps or None, fov or None))

    def _send(self, name: str, event: viser.GuiEvent[Any]) -> None:
        """Send a file to the tab that asks; runs on a thread of the server's pool."""
        session = self._session
        if event.client is None or session is None or session.track is None or session.place is None:
            return
        text = texts_of_track(session.track.track, session.place.field.info.placed)[name]
        event.client.send_file_download(name, text.encode(), save_immediately=True)

    def show(self, session: Session) -> None:
        """Show the track as far as the timeline shows it."""
        self._session = session
        self._upload.disabled = not session.may_begin
        track = session.shown_track
        there = track is not None and bool(track.steps)
        for button in (*self._takes, self._forget):
            button.visible = there and not session.growing
        self._said.content = describe(session.track, track)
