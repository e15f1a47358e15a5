"""How far a ray may leap over empty cells: the chessboard distance transform of a grid (Rosenfeld and Pfaltz, 1968)."""

import numpy as np

from nerfnav.core.jit import kernel

FARTHEST = 255
"""Largest distance that is told apart [cells]."""


@kernel()
def leaps_over(raw, least):
    """Distance (nx-1, ny-1, nz-1) of each cell from the nearest one that has a corner with `raw` of at least `least`.

    Distances are those of a king on a chessboard, at most FARTHEST: around a cell at distance d, the cube of 2 d - 1
    cells along each edge is empty.
    """
    nx, ny, nz = raw.shape[0] - 1, raw.shape[1] - 1, raw.shape[2] - 1
    distance = np.full((nx + 2, ny + 2, nz + 2), FARTHEST, np.int32)  # with a border, so that no edge is special
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                most = raw[i, j, k]
                for corner in range(1, 8):
                    most = max(most, raw[i + (corner >> 2), j + ((corner >> 1) & 1), k + (corner & 1)])
                if most >= least:
                    distance[i + 1, j + 1, k + 1] = 0
    for i in range(1, nx + 1):
        for j in range(1, ny + 1):
            for k in range(1, nz + 1):
                _nearer(distance, i, j, k, 1)
    for i in range(nx, 0, -1):
        for j in range(ny, 0, -1):
            for k in range(nz, 0, -1):
                _nearer(distance, i, j, k, -1)
    return distance[1:-1, 1:-1, 1:-1].astype(np.uint8)


@kernel(inline=True)
def _nearer(distance, i, j, k, way):
    """One more than the least distance of the 13 neighbours that a scan along `way` has passed, where that is less."""
    least = distance[i, j, k]
    if least == 0:
        return
    for b in range(-1, 2):
        for c in range(-1, 2):
            least = min(least, distance[i - way, j + b, k + c] + 1)
        least = min(least, distance[i, j - way, k + b] + 1)
    distance[i, j, k] = min(least, distance[i, j, k - way] + 1)
