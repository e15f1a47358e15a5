"""The update of an inverse Hessian by its last step."""

import numpy as np

from nerfnav.compiled import kernel


@kernel()
def rank_two(inverse, step, along, straight, mixed):
    """inverse + straight * step step' - mixed * (along step' + step along'), (k, k)."""
    count = step.shape[0]
    updated = np.empty_like(inverse)
    for i in range(count):
        own, other = straight * step[i] - mixed * along[i], mixed * step[i]
        for j in range(count):
            updated[i, j] = inverse[i, j] + own * step[j] - other * along[j]
    return updated
