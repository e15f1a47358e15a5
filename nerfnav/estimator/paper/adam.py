"""Adam on the manifold (paper Eq. 8): every step is taken in the tangent of the state before it.

    d_k = Adam(gradient of J(x_k (+) d) at d = 0),   x_k+1 = x_k (+) d_k

The paper's first formulation stays in one tangent plane, that of the start: x_k+1 = x_0 (+) (d_0 + ... + d_k), with
the gradient taken there.

(Kingma and Ba, "Adam: a method for stochastic optimization", 2015.)
"""

from collections import deque
from collections.abc import Iterator

import torch

from nerfnav.estimator.core.filter_config import DescentConfig
from nerfnav.estimator.paper.cost import CostTerms, PoseCost
from nerfnav.estimator.paper.retraction import Retraction
from nerfnav.robots import ATTITUDE, POSITION, TANGENT, RigidState


def descend(
    cost: PoseCost, start: RigidState, config: DescentConfig, retraction: Retraction
) -> Iterator[tuple[RigidState, CostTerms]]:
    """Yield every state of a descent from `start`, which is the first, with J there; the last is the result."""
    scaled = torch.zeros(TANGENT, requires_grad=True)  # in units of the learning rates
    optimizer = torch.optim.Adam([scaled], lr=1.0, betas=(0.9, config.memory))
    decay = torch.optim.lr_scheduler.ExponentialLR(optimizer, config.final_rate ** (1 / config.iterations))
    state, base, rates = start, start, config.rates()
    before = deque([start], maxlen=config.stop_window + 1)
    for _ in range(config.iterations):
        terms = cost.terms(base.retract(rates * scaled))
        yield state, terms
        optimizer.zero_grad()
        terms.total.backward()
        optimizer.step()
        decay.step()
        state = retraction(base, rates * scaled.detach())
        if config.recursive:
            base = state
            scaled.data.zero_()
        before.append(state)
        if config.stop_change is not None and _has_settled(before, config.stop_change):
            break
    with torch.no_grad():
        yield state, cost.terms(state)


def _has_settled(states: deque[RigidState], change: float) -> bool:
    if len(states) < (states.maxlen or 0):
        return False
    moved = states[0].local(states[-1]).abs()
    return bool(torch.maximum(moved[POSITION].max(), moved[ATTITUDE].max()) < change)
