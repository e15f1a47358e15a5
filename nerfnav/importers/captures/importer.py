"""What a capture must have for a field to be learned from it."""

import os
from pathlib import Path

import numpy as np

from nerfnav.importers.captures.views import CaptureError, View, Views

LEAST_IMAGES = 4
"""Photographs below which nothing can be told about depth."""
_MOST_MISSING = 0.5
"""Share of the named photographs that may be missing."""
_NO_PARALLAX = 1e-9
"""Spread of the cameras, relative to how far from the origin they are, under which they stand in one place."""


def require_enough(found: Views, views: list[View]) -> None:
    named, used = len(found.views), len(views)
    if named - used > _MOST_MISSING * named:
        missing = next(view for view in found.views if view not in views)
        raise CaptureError(
            f"the capture names {named} photographs, but only {used} of them are there and readable: "
            f"the first that is not is {missing.name}"
        )
    if used < LEAST_IMAGES:
        plural = "s" * (used != 1)
        raise CaptureError(
            f"a capture of {used} photograph{plural} tells nothing about depth: at least {LEAST_IMAGES} from "
            "different places are needed"
        )


def require_inside(found: Views, folder: Path) -> None:
    files = (path for view in found.views for path in (view.path, *(() if view.depth is None else view.depth.files)))
    outside = next((path for path in files if not path.resolve().is_relative_to(folder.resolve())), None)
    if outside is not None:
        told = Path(os.path.relpath(outside, folder)).as_posix()
        raise CaptureError(f"the capture names a photograph outside of its own folder: {told}")


def require_parallax(poses: np.ndarray) -> None:
    centers = poses[:, :3, 3]
    if np.ptp(centers, axis=0).max() <= _NO_PARALLAX * max(1e-3, np.abs(centers).max()):
        raise CaptureError("all photographs were taken from one place: without parallax there is no depth to learn")
