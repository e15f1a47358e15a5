"""Parts of a grid that are looked at in training: one byte for each block of 4 x 4 x 4 cells, one bit for each of its 8
parts of 2 x 2 x 2 cells, so that rays pass what is empty within two cells of a surface and never touch its nodes.
"""

import numpy as np

from nerfnav.compiled import kernel

ALL_PARTS = 0xFF
"""The byte of a block of which every part is looked at."""


@kernel()
def parts_above(values, slots, threshold, parts):
    """Fill `parts` (bx, by, bz) with those that have a node, borders included, of raw density above the threshold.

    Blocks without a slot (`slots` < 0) have nothing to learn in.
    """
    nx, ny, nz = values.shape[0], values.shape[1], values.shape[2]
    parts[:] = 0
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if values[i, j, k, 0] <= threshold:
                    continue
                for before in range(8):  # a node on the border of a part belongs to that before it, too
                    x, y, z = before >> 2, (before >> 1) & 1, before & 1
                    if (x and (i & 1 or i == 0)) or (y and (j & 1 or j == 0)) or (z and (k & 1 or k == 0)):
                        continue
                    a, b, c = (i >> 1) - x, (j >> 1) - y, (k >> 1) - z
                    if slots[a >> 1, b >> 1, c >> 1] >= 0:
                        parts[a >> 1, b >> 1, c >> 1] |= np.uint8(1 << (((a & 1) << 2) | ((b & 1) << 1) | (c & 1)))


@kernel(inline=True)
def empty_side(parts, i, j, k):
    """log2 of the cells along each edge of what is empty around cell (i, j, k): a part, a block; 0 where it is not."""
    byte = parts[np.uint64(i >> 2), np.uint64(j >> 2), np.uint64(k >> 2)]
    if byte == 0:
        return 2
    part = (((i >> 1) & 1) << 2) | (((j >> 1) & 1) << 1) | ((k >> 1) & 1)
    return 0 if (byte >> part) & 1 else 1
