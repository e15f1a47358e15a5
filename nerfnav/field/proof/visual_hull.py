"""Visual hull: the space in which things can be that silhouettes show (Laurentini, "The visual hull concept for
silhouette-based image understanding", PAMI 1994). Light that passes beside all silhouettes has met nothing.

Silhouettes are widened by what a node stands for, so that no node is left out of which a part may hold something.
"""

import math
from dataclasses import replace

import cv2
import numpy as np
import torch
from jaxtyping import Bool
from torch import Tensor

from nerfnav.geometry import Box, PosedImages, count_outside_silhouettes, node_positions

_STRAY = 0.02
"""Share of the photographs that may show a node as clear although it is not: poses and outlines are never perfect."""
_NEAREST = 0.1
"""Distance of a camera from the box at which silhouettes are widened no further, in diagonals of the box."""


def widen_silhouettes(photographs: PosedImages, box: Box, spacing: float) -> PosedImages:
    """The photographs with silhouettes reaching as far as nodes `spacing` [m] apart do, to each side.

    Raises ValueError for photographs that are not cut out.
    """
    if photographs.silhouettes is None:
        raise ValueError("these photographs are not cut out")
    diagonal = float(box.size.norm())
    centers = photographs.poses.position
    away = (centers - centers.new_tensor((box.lower + box.upper).tolist()) / 2).norm(dim=-1) - diagonal / 2
    reach = [
        math.ceil(spacing * photographs.camera.fx / max(distance, _NEAREST * diagonal)) for distance in away.tolist()
    ]
    wide = [
        cv2.dilate(shown.numpy().astype(np.uint8), np.ones((2 * pixels + 1, 2 * pixels + 1), np.uint8)) > 0
        for shown, pixels in zip(photographs.silhouettes, reach, strict=True)
    ]
    return replace(photographs, silhouettes=torch.from_numpy(np.stack(wide)))


def compute_hull(photographs: PosedImages, box: Box, shape: tuple[int, int, int]) -> Bool[Tensor, "nx ny nz"]:
    """Nodes that photographs with widened silhouettes (see `widen_silhouettes`) see, and do not show as clear."""
    clear, seen = count_outside_silhouettes(photographs, node_positions(box, shape).reshape(-1, 3))
    return ((seen > 0) & (clear <= _STRAY * seen)).reshape(shape)
