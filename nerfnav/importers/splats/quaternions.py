"""Unit quaternions without their largest part ("smallest three"): the three others lie within 1 / sqrt(2) of zero."""

import numpy as np
from jaxtyping import Float, Int

WXYZ, XYZW = (0, 1, 2, 3), (1, 2, 3, 0)
"""Where the parts that a file numbers 0 to 3 stand in (w, x, y, z)."""
_OTHERS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])


def from_smallest_three(
    smaller: Float[np.ndarray, "n 3"], largest: Int[np.ndarray, " n"], order: tuple[int, ...] = WXYZ
) -> Float[np.ndarray, "n 4"]:
    """(w, x, y, z) from the three smaller parts, in the file's order, and the number of the one left out, 0 to 3."""
    parts = np.empty((len(smaller), 4))
    np.put_along_axis(parts, _OTHERS[largest], smaller, 1)
    left = np.sqrt(np.maximum(0, 1 - (smaller.astype(np.float64) ** 2).sum(1)))
    np.put_along_axis(parts, largest[:, None], left[:, None], 1)
    wxyzs = np.empty_like(parts)
    wxyzs[:, list(order)] = parts
    return wxyzs
