"""Import a capture: what its files say, its photographs, and where it all lies in the world."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from nerfnav.importers.captures import depths, pictures
from nerfnav.importers.captures.assembled import LONGEST, assembled
from nerfnav.importers.captures.formats import read_views
from nerfnav.importers.captures.imported import ImportConfig, ImportStep
from nerfnav.importers.captures.pictures import Picture
from nerfnav.importers.captures.requirements import require_enough, require_inside, require_parallax
from nerfnav.importers.captures.views import CaptureError, View

_MOST_BYTES = 4 << 30
"""Memory that the photographs may take."""


def import_capture(source: Path, config: ImportConfig) -> Iterator[ImportStep]:
    """Read a capture, one step for each photograph; the last step carries all of it.

    Raises CaptureError, in one sentence, for what no field can be trained from.
    """
    found = read_views(source)
    require_enough(found, [view for view in found.views if view.exists])
    if config.within is not None:
        require_inside(found, config.within)
    views: list[View] = []
    shots: list[Picture] = []
    maps: list[np.ndarray | None] = []
    downscale, held = config.downscale, 0
    for index, view in enumerate(found.views):
        pixels = pictures.read_pixels(view.path, view.lens) if view.exists else None
        if pixels is not None:
            downscale = downscale or max(1, -(-max(pixels.shape[:2]) // LONGEST))
            views.append(view)
            shots.append(_shrunk(view, pixels, downscale))
            maps.append(depths.read_depth(view) if config.depth and view.depth is not None else None)
            held += shots[-1].pixels.nbytes + (0 if maps[-1] is None else maps[-1].nbytes)
        if held > _MOST_BYTES:
            raise CaptureError(f"the photographs take more than {_MOST_BYTES >> 30} GB of memory: make them smaller")
        yield ImportStep(0.9 * (index + 1) / len(found.views))
    require_enough(found, views)
    require_parallax(np.stack([view.pose for view in views]))
    yield ImportStep(1.0, assembled(found, (views, shots, maps), config, downscale or 1))


def _shrunk(view: View, pixels: np.ndarray, downscale: int) -> Picture:
    try:
        return pictures.shrunk(pixels, view.lens, downscale)
    except CaptureError as error:
        raise CaptureError(f"{view.name}: {error}") from error
