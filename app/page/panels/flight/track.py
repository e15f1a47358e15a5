"""Track panel: track the camera of a video or of pictures, show its poses, take the trajectory away.

Tracks in words and numbers are HTML.
"""


from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import viser

from nerfnav.export import TRACK_FILES, texts_of_track
from nerfnav.tracking import TrackStatus
from nerfnav_app.page.kit.html import fine, note, table, warning
from nerfnav_app.places.uploads import TRACK_SUFFIXES, TrackSources, UploadError
from nerfnav_app.state.actions import Command, Tell
from nerfnav_app.state.session import Session
from nerfnav_app.state.tracks import ForgetTrack, StartTrack, TrackRecord
from nerfnav_app.text import number, sentence


def describe(track: TrackRecord | None, shown: TrackRecord | None) -> str:
    """What became of the frames, and the numbers of the last one that is shown, as HTML."""
    if track is None:
        return note("Bring a video, or a zip of pictures, that was taken in this place.")
    if shown is None or not shown.steps:
        return note("Looking for its camera everywhere: the first time this takes a while.")
    last = shown.steps[-1].tracked
    counts = Counter(step.tracked.status for step in track.steps)
    rows = [("Frames", str(len(track.steps))), *((_NAMES[kind], str(count)) for kind, count in counts.items())]
    if last.covariance is not None:
        deviation = last.covariance.diagonal().clamp_min(0).sqrt().numpy()
        at = last.pose.position.tolist() if last.pose is not None else []
        rows += [
            ("Camera at", ", ".join(f"{value:.2f}" for value in at) + " m"),
            ("Expected error", number(100 * float(np.linalg.norm(deviation[:3])), "cm")),
            ("of its attitude", number(float(np.rad2deg(np.linalg.norm(deviation[3:]))), "°")),
        ]
    if last.difference is not None:
        rows.append(("Colours differ by", number(100 * last.difference, "%")))
    rows.append(("Time for a frame", number(last.ms, "ms")))
    say = fine if last.status.updated else warning
    return table(rows) + say(sentence(last.status.value))


def summarize_track(track: TrackRecord) -> str:
    """One line on a track, such as "Tracked rest.mp4: 98 of 100 frames, lost once"."""
    statuses = [step.tracked.status for step in track.steps]
    told = sum(status.updated for status in statuses)
    lost = statuses.count(TrackStatus.FOUND_AGAIN) + (statuses[-1] is TrackStatus.LOST)
    times = {0: "never lost", 1: "lost once"}.get(lost, f"lost {lost} times")
    return f"Tracked {track.name}: {told} of {len(track.steps)} frames, {times}"


_NAMES = {
    TrackStatus.SEARCHING: "Not found yet",
    TrackStatus.FOUND: "Found from nothing",
    TrackStatus.FOLLOWED: "Followed",
    TrackStatus.PREDICTED: "Predicted alone",
    TrackStatus.LOST: "Lost",
    TrackStatus.FOUND_AGAIN: "Found again",
}


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
                "Track a video", color="gray", icon=viser.Icon.VIDEO, mime_type=",".join(TRACK_SUFFIXES),
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
