"""Track panel: track the camera of a video or of pictures, show its poses, download the trajectory."""

from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import viser

from nerfnav.export import TRACK_FILES, texts_of_track
from nerfnav.tracking import TrackStatus
from nerfnav_app.page.kit.html import fine, note, table, warning
from nerfnav_app.page.kit.widgets import post_on
from nerfnav_app.places.uploads import TRACK_SUFFIXES, TrackSources, UploadError
from nerfnav_app.state.actions import Command, Notify
from nerfnav_app.state.session import Session
from nerfnav_app.state.tracks import RemoveTrack, StartTrack, TrackRecord
from nerfnav_app.text import number, sentence


def describe(track: TrackRecord | None, shown: TrackRecord | None) -> str:
    """Format the status of all frames and the numbers of the last shown one as HTML."""
    if track is None:
        return note("Upload a video or a zip of pictures from this place.")
    if shown is None or not shown.steps:
        return note("Localizing the camera globally: the first time takes longer.")
    last = shown.steps[-1].tracked
    counts = Counter(step.tracked.status for step in track.steps)
    rows = [("Frames", str(len(track.steps))), *((STATUS_LABELS[kind], str(count)) for kind, count in counts.items())]
    if last.covariance is not None:
        deviation = last.covariance.diagonal().clamp_min(0).sqrt().numpy()
        at = last.pose.position.tolist() if last.pose is not None else []
        rows += [
            ("Camera position", ", ".join(f"{value:.2f}" for value in at) + " m"),
            ("Standard deviation", number(100 * float(np.linalg.norm(deviation[:3])), "cm")),
            ("of the attitude", number(float(np.rad2deg(np.linalg.norm(deviation[3:]))), "°")),
        ]
    if last.difference is not None:
        rows.append(("Colour difference", number(100 * last.difference, "%")))
    rows.append(("Computed in", number(last.ms, "ms")))
    say = fine if last.status.updated else warning
    return table(rows) + say(sentence(last.status.value))


def summarize_track(track: TrackRecord) -> str:
    """Summarize a track in a line, such as "Tracked rest.mp4: 98 of 100 frames, lost once"."""
    statuses = [step.tracked.status for step in track.steps]
    updated = sum(status.updated for status in statuses)
    lost = statuses.count(TrackStatus.FOUND_AGAIN) + (statuses[-1] is TrackStatus.LOST)
    times = {0: "never lost", 1: "lost once"}.get(lost, f"lost {lost} times")
    return f"Tracked {track.name}: {updated} of {len(track.steps)} frames, {times}"


STATUS_LABELS = {
    TrackStatus.SEARCHING: "Not found yet",
    TrackStatus.FOUND: "Localized globally",
    TrackStatus.FOLLOWED: "Tracked",
    TrackStatus.PREDICTED: "Predicted only",
    TrackStatus.LOST: "Lost",
    TrackStatus.FOUND_AGAIN: "Relocalized",
}
"""Label of each status of a frame."""


class TrackPanel:
    """Panel of a camera track: its source, its camera and its results."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None], sources: TrackSources) -> None:
        """Add the widgets; `post` takes the commands, `sources` stores uploads."""
        self._post, self._sources = post, sources
        self._session: Session | None = None
        with server.gui.add_folder("Track a camera", expand_by_default=True):
            self._fov = server.gui.add_number(
                "Field of view [°]", 0.0, min=0.0, max=170.0, step=0.1,
                hint="Horizontal; 0: that of the place's photographs, else 90",
            )  # fmt: skip
            self._fps = server.gui.add_number(
                "Pictures per second", 0.0, min=0.0, max=1000.0, step=0.1,
                hint="For pictures without times; 0: as in the video or the names of the pictures",
            )  # fmt: skip
            self._upload = server.gui.add_upload_button(
                "Track a video", color="gray", icon=viser.Icon.VIDEO, mime_type=",".join(TRACK_SUFFIXES),
                hint="A video or a zip of pictures from this place",
            )  # fmt: skip
            self._status = server.gui.add_html(note("Upload a video from this place."))
            self._downloads = {
                name: server.gui.add_button(name, icon=viser.Icon.DOWNLOAD, visible=False) for name in TRACK_FILES
            }
            self._remove = server.gui.add_button(
                "Remove the track", color="gray", icon=viser.Icon.ERASER, visible=False
            )
        self._upload.on_upload(self._take)
        for name, button in self._downloads.items():
            button.on_click(partial(self._send, name))
        post_on(self._remove.on_click, post, RemoveTrack)

    def _take(self, event: viser.GuiEvent[Any]) -> None:
        """Store the upload and track its camera; runs on a thread of the server's pool."""
        upload = self._upload.value
        fps, fov = float(self._fps.value), float(self._fov.value)
        try:
            source = self._sources.keep(upload.name, upload.content)
        except UploadError as error:
            self._post(Notify("Not tracked", str(error), bad=True))
        else:
            self._post(StartTrack(source, upload.name, fps or None, fov or None))

    def _send(self, name: str, event: viser.GuiEvent[Any]) -> None:
        """Send a file to the tab that requests it; runs on a thread of the server's pool."""
        session = self._session
        if event.client is None or session is None or session.track is None or session.place is None:
            return
        text = texts_of_track(session.track.track, session.place.field.info.placed)[name]
        event.client.send_file_download(name, text.encode(), save_immediately=True)

    def show(self, session: Session) -> None:
        """Show the track up to the time that the timeline shows."""
        self._session = session
        self._upload.disabled = not session.may_begin
        track = session.shown_track
        there = track is not None and bool(track.steps)
        for button in (*self._downloads.values(), self._remove):
            button.visible = there and not session.growing
        self._status.content = describe(session.track, track)
