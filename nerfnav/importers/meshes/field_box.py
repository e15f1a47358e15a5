"""Box and voxels of a field that a mesh asks for."""

import math

import torch

from nerfnav.geometry import Box
from nerfnav.importers.meshes.config import SceneConfig
from nerfnav.world import Vantage


def box_and_voxel(bounds: Box, vantage: Vantage, config: SceneConfig) -> tuple[Box, float]:
    """Where the field lives, and the size of its voxels [m]."""
    if config.placement.box is not None:
        box = Box.of(*config.placement.box)
        return box, config.voxel or _voxel(box, config.nodes)
    aside = config.aside * float(bounds.size.max())
    above = max(config.headroom * float(bounds.size[2]), aside)
    if vantage is Vantage.INSIDE:
        aside = above = 0.0
    upper = bounds.upper + torch.tensor([aside, aside, above])
    box = Box(bounds.lower - torch.tensor([aside, aside, 0.0]), upper)
    voxel = config.voxel or _voxel(box, config.nodes)
    border = config.below * voxel
    around = border if vantage is Vantage.INSIDE else 0.0
    return Box(box.lower - torch.tensor([around, around, border]), box.upper + around), voxel


def _voxel(box: Box, nodes: float) -> float:
    """The size at which a box has so many nodes, rounded to two digits [m]."""
    exact = float((box.size.double().prod() / nodes) ** (1 / 3))
    digits = 1 - math.floor(math.log10(exact))
    return round(exact, digits)
