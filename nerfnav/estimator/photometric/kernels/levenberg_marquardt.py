"""Steps of Levenberg and Marquardt, damped and stretched: twin of levenberg_marquardt.py in the folder above."""

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.geometry.linear import solve_positive
from nerfnav.geometry.rotations import turned

LEAST_DAMPING, MOST_DAMPING = 1e-7, 1e7
SLOWEST = 0.99


@kernel()
def damped_step(seen, known, slope, weight, step):
    """Fill the damped Gauss-Newton step (8); returns whether there is one: where not, it is 0."""
    damped = np.empty((8, 8))
    for i in range(8):
        for j in range(8):
            damped[i, j] = seen[i, j] + known[i, j]
    for i in range(8):
        damped[i, i] += weight * max(damped[i, i], 1e-9)
    found = solve_positive(damped, slope, step)
    for i in range(8):
        step[i] = -step[i] if found else 0.0
    return found


@kernel()
def stretched(seen, known, before, stretch, step, most):
    """Stretch a step to where its successors would lead, at most by `most`; returns by how much.

    `before` is the step before it, which was stretched by `stretch` (0: there is none, or it was in vain), and then
    what this one was.
    """
    shared, square = 0.0, 0.0
    for i in range(8):
        scale = seen[i, i] + known[i, i]
        shared += scale * step[i] * before[i]
        square += scale * before[i] * before[i]
    rate = 1.0 - (1.0 - shared / square) / stretch if stretch > 0.0 and square > 0.0 else 0.0
    found = min(max(1.0 / (1.0 - min(rate, SLOWEST)), 1.0), most)
    for i in range(8):
        before[i] = step[i]
        step[i] *= found
    return found


@kernel()
def move(guesses, held, step, trial):
    """The guess to try: that which is held (+) step. `held` and `trial` are places in `guesses`."""
    turned(guesses[0][held], step[3], step[4], step[5], guesses[0][trial])
    for axis in range(3):
        guesses[1][trial][axis] = guesses[1][held][axis] + step[axis]
    for side in range(2):
        guesses[2][trial][side] = guesses[2][held][side] + step[6 + side]
