"""Squared excess over a bound, as a share of it: twin of `penalty` in robots/robot.py, for compiled maps."""

import math

from nerfnav.core.jit import kernel


@kernel()
def over(value, bound, weight, by, at):
    """The penalty on |value| > bound; adds its derivative to by[at]."""
    excess = abs(value) / bound - 1.0
    if not excess > 0.0:
        return 0.0
    by[at] += 2.0 * weight * excess / bound * (1.0 if value > 0.0 else -1.0)
    return weight * excess * excess


@kernel()
def over_in_plane(x, y, bound, weight, by):
    """The penalty on a vector of the plane that is longer than bound; adds its derivative to by[0] and by[1]."""
    size = math.sqrt(x * x + y * y)
    excess = size / bound - 1.0
    if not excess > 0.0:
        return 0.0
    slope = 2.0 * weight * excess / (bound * size)
    by[0] += slope * x
    by[1] += slope * y
    return weight * excess * excess
