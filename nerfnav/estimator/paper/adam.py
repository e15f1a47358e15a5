"""Adam on the manifold (paper Eq. 8): every step is taken in the tangent of the state before it.

    d_k = Adam(gradient of J(x_k (+) d) at d = 0),   x_k+1 = x_k (+) d_k

The paper's first formulation stays in one tangent plane, that of the start: x_k+1 = x_0 (+) (d_0 + ... + d_k), with
the gradient taken there.

(Kingma and Ba, "Adam: a method for stochastic optimization", 2015.)
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.paper.cost import CostTerms, PoseCost
from nerfnav.estimator.paper.retraction import Retraction
from nerfnav.robots import ATTITUDE, POSITION, TANGENT, RigidState


@dataclass(frozen=True)
class DescentConfig:
    """How Adam goes down."""

    iterations: int = 300
    """Steps at most (paper: 300)."""
    memory: float = 0.9
    """Adam's beta_2. With the usual 0.999 the steep start is remembered to the end, and the flat valley in which
    position and attitude trade against each other is never followed down."""
    position_rate: float = 5e-3
    """Learning rate of the position [m]: about the length of a first step."""
    velocity_rate: float = 5e-3
    """Learning rate of the velocity [m/s]."""
    attitude_rate: float = 5e-3
    """Learning rate of the attitude [rad]."""
    body_rate_rate: float = 5e-3
    """Learning rate of the body rate [rad/s]."""
    final_rate: float = 0.05
    """The learning rates fall exponentially to this share of their first value."""
    stop_change: float | None = None
    """Stop when no pose number moved more than this in `stop_window` steps [m, rad]; None (paper): never."""
    stop_window: int = 10
    """Steps over which `stop_change` is judged."""
    recursive: bool = True
    """Whether each step is taken in the tangent of the state before it; False: all in the tangent of the start."""

    def rates(self) -> Float[Tensor, "12"]:
        """The first learning rate of each tangent number."""
        parts = (self.position_rate, self.velocity_rate, self.attitude_rate, self.body_rate_rate)
        return torch.tensor(parts, dtype=torch.float32).repeat_interleave(3)


def descend(
    cost: PoseCost, start: RigidState, config: DescentConfig, retraction: Retraction
) -> Iterator[tuple[RigidState, CostTerms]]:
    """Every state on the way down from `start`, which is the first, with J there; the last is the result."""
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
