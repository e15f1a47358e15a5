"""Quality of a training: how fine and how long, measured by what the source itself asks for.

What a source asks for follows from the size of the place and from the pictures (see its `gather`): quality says how
much more or less than that. A grid finer than the pictures' pixels learns their noise, so pixels bound it.
"""

from dataclasses import dataclass

from nerfnav.geometry import Box, PosedImages
from nerfnav_app.places.learning import QualityName


@dataclass(frozen=True)
class Quality:
    """How fine and how long."""

    nodes: float
    """Nodes of the field, in those that the source asks for."""
    steps: float
    """Training steps, in those that the source asks for."""


QUALITIES: dict[QualityName, Quality] = {
    "draft": Quality(1 / 4, 1 / 3),
    "good": Quality(1.0, 1.0),
    "best": Quality(3.0, 4.0),
}


def voxel_of(quality: Quality, suited: float, pixel: float) -> float:
    """Distance of nodes [m] where a source asks for `suited` and its pixels show `pixel` [m] each."""
    wanted = suited * quality.nodes ** (-1 / 3)
    return wanted if quality.nodes <= 1 else min(suited, max(wanted, pixel))


def pixel_size(photographs: PosedImages, box: Box) -> float:
    """What a pixel covers at the middle of the box [m]: the median of the photographs."""
    middle = (box.lower + box.upper) / 2
    return float((photographs.poses.position - middle).norm(dim=-1).median()) / photographs.camera.fx
