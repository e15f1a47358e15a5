"""Retraction: bring the filter's mean back onto the manifold after every step (paper Eq. 8).

The paper used Princeton's LieTorch. It is used here where it can be imported; elsewhere nerfnav's own
formulas do the same. Another library bears the name lietorch as well: only Princeton's has SE3.
"""

import importlib
from collections.abc import Callable
from functools import cache, partial
from types import ModuleType

from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.robots import ATTITUDE, BODY_RATE, POSITION, VELOCITY, RigidState

Retraction = Callable[[RigidState, Float[Tensor, "12"]], RigidState]
"""x (+) d, without gradients; the attitude of the result is a rotation matrix to rounding."""


def retract(state: RigidState, tangent: Float[Tensor, "12"]) -> RigidState:
    """Return x (+) d by nerfnav's own formulas; rounding drift of the attitude is taken out."""
    moved = state.retract(tangent)
    return RigidState(moved.position, moved.velocity, so3.project(moved.rotation), moved.body_rate)


def retract_with_lietorch(lietorch: ModuleType, state: RigidState, tangent: Float[Tensor, "12"]) -> RigidState:
    """Return x (+) d by LieTorch's exponential map of SO(3)."""
    turn = lietorch.SO3.exp(tangent[None, ATTITUDE]).matrix()[0, :3, :3]
    return RigidState(
        state.position + tangent[POSITION],
        state.velocity + tangent[VELOCITY],
        so3.project(state.rotation @ turn),
        state.body_rate + tangent[BODY_RATE],
    )


def choose_retraction(lietorch: ModuleType | None) -> Retraction:
    """Return the retraction by LieTorch where it is installed, else nerfnav's own."""
    return retract if lietorch is None else partial(retract_with_lietorch, lietorch)


@cache
def princeton_lietorch() -> ModuleType | None:
    """Return Princeton's LieTorch, or None where it is not installed or the name leads to the other library."""
    try:
        module = importlib.import_module("lietorch")
    except (ImportError, OSError):  # OSError: built for CUDA libraries that this machine lacks
        return None
    return module if hasattr(module, "SE3") and hasattr(module, "SO3") else None


def retraction_backend() -> str:
    """Return the name of the library that does the retraction on this machine."""
    return "nerfnav" if princeton_lietorch() is None else "LieTorch"
