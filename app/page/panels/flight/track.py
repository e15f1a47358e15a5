"""Tracks in words and numbers, as HTML."""

from collections import Counter

import numpy as np

from nerfnav.tracking import TrackStatus
from nerfnav_app.page.kit.html import fine, note, table, warning
from nerfnav_app.state.tracks import TrackRecord
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


def ended(track: TrackRecord) -> str:
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
