"""Report of a track: how many frames there were, and what became of them."""

from itertools import pairwise
from typing import Any

import numpy as np

from nerfnav.tracking import Tracked, TrackStatus


def summary_of(track: list[Tracked]) -> dict[str, Any]:
    """What `track --json` prints: how many frames, and what became of them; times are of updates."""
    times = [tracked.ms for tracked in track if tracked.status is TrackStatus.FOLLOWED]
    low, high = np.quantile(times, (0.5, 0.95)).tolist() if times else (None, None)
    known = [False, *(tracked.status.knows for tracked in track)]
    return {
        "frames": len(track),
        "updated": sum(tracked.status.updated for tracked in track),
        "lost": sum(before and not now for before, now in pairwise(known)) + _found_at_once(track),
        "found_again": sum(tracked.status is TrackStatus.FOUND_AGAIN for tracked in track),
        "ms_p50": low,
        "ms_p95": high,
    }


def _found_at_once(track: list[Tracked]) -> int:
    """Times that a track was lost and found again with the same frame."""
    return sum(before.status.knows and now.status is TrackStatus.FOUND_AGAIN for before, now in pairwise(track))
