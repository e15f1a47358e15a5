"""What pixels tell of a camera's motion: derivatives alone, before anything is compared."""

import numpy as np

from nerfnav.compiled import kernel
from nerfnav.estimator.kernels.descent import look


@kernel()
def slopes(grid, sight, rotation, position):
    """Derivatives (6, 3 m) of m pixels' colours by the camera's motion in the world's axes, centre and turn, at a body
    pose; `grid` and `sight` as `descend` has them."""
    pixels = sight[0].shape[0]
    rows, first = np.empty((9, 3 * pixels), np.float32), np.empty(pixels, np.float32)
    anchor, residuals = np.full((4, 3), np.inf), np.empty((pixels, 3), np.float32)
    scratch = rows, first, anchor, np.ones(3 * pixels, np.float32)
    look(grid, sight, (rotation, position, np.zeros(2)), (np.inf, -1.0), residuals, scratch)
    return rows[:6]
