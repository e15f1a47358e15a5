"""Texel rasterisation: draw triangles into an atlas, with a border around each."""

import math

import numpy as np

from nerfnav.core.jit import kernel

REACH = np.float32(1.42)
"""Texels around triangles are theirs too, so far from their edges: bilinear lookups inside need no others."""


@kernel()
def rasterize(corners, nearest, face_at, weights):
    """Write which triangle each texel shows, and the barycentric weights of its middle there.

    `corners` (m, 3, 2) are x, y in texels, the middle of texel [y, x] at (x, y). `nearest` (h, w), -inf at first, is
    how deep inside its triangle a texel is, below 0 outside; `face_at` (h, w), -1 at first; `weights` (h, w, 3), with
    negative ones outside.
    """
    height, width = nearest.shape
    for face in range(corners.shape[0]):
        ax, ay = corners[face, 0, 0], corners[face, 0, 1]
        bx, by = corners[face, 1, 0], corners[face, 1, 1]
        cx, cy = corners[face, 2, 0], corners[face, 2, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        # weights times heights of the triangle are distances from its edges
        opposite_a = abs(area) / math.sqrt((cx - bx) ** 2 + (cy - by) ** 2)
        opposite_b = abs(area) / math.sqrt((cx - ax) ** 2 + (cy - ay) ** 2)
        opposite_c = abs(area) / math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
        left, right = max(0, math.ceil(min(ax, bx, cx) - REACH)), min(width - 1, int(max(ax, bx, cx) + REACH))
        top, bottom = max(0, math.ceil(min(ay, by, cy) - REACH)), min(height - 1, int(max(ay, by, cy) + REACH))
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                b = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
                c = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
                a = np.float32(1.0) - b - c
                inside = min(a * opposite_a, b * opposite_b, c * opposite_c)
                if inside >= -REACH and inside > nearest[y, x]:
                    nearest[y, x], face_at[y, x] = inside, face
                    weights[y, x, 0], weights[y, x, 1], weights[y, x, 2] = a, b, c
