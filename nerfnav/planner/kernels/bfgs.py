"""The update of an inverse Hessian by its last step."""

from nerfnav.core.jit import kernel


@kernel()
def rank_two(inverse, step, along, straight, mixed):
    """inverse += straight * step step' - mixed * (along step' + step along'), (k, k)."""
    count = step.shape[0]
    for i in range(count):
        own, other = straight * step[i] - mixed * along[i], mixed * step[i]
        for j in range(count):
            inverse[i, j] += own * step[j] - other * along[j]
