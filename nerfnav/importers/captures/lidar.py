"""Depth of telephones and tablets with a LiDAR, as ARKit gives it to the apps that export it.

ARKit tells for each depth whether its confidence is low, medium or high; apps write 0, 1, 2 or 0, 127, 255. Low is
"quite unreliable" (Polycam), and a depth that is too large says that there is air where a wall is: it is left out, and
so is what lies beyond the sensor's reach, where depth is a guess.
"""

from pathlib import Path

from nerfnav.importers.captures.views import DepthFile

_REACH = 5.0
"""Of the LiDAR [m]."""


def lidar_depth(path: Path, confidence: Path | None, unit: float = 0.001) -> DepthFile | None:
    """The depth map at `path` in a unit of `unit` [m], with its confidence where there is such a file; None without."""
    if not path.is_file():
        return None
    return DepthFile(path, unit, confidence if confidence is not None and confidence.is_file() else None, _REACH)
