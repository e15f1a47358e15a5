"""A route: from where to where, and in how many time steps."""

from dataclasses import dataclass

from nerfnav.robots import RigidState
from nerfnav.structs import TensorStruct


@dataclass(frozen=True)
class Route(TensorStruct):
    """A boundary value problem in time: two states, and the steps between them."""

    start: RigidState
    """Met exactly at time 0."""
    goal: RigidState
    """Met exactly at the last time."""
    steps: int = 20
    """Number of time steps; 20 in the paper."""
    dt: float = 0.1
    """Length of a step [s]; 0.1 in the paper."""
    keeps_headings: bool = False
    """Whether a plan that is carried on keeps the headings that it has (see headings.py), and is not free to turn."""
