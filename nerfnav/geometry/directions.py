"""Fibonacci spiral: unit directions that are spread evenly over the sphere, or over a part of it."""

import math

import torch
from jaxtyping import Float
from torch import Tensor

_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


def fibonacci_directions(heights: Float[Tensor, " n"]) -> Float[Tensor, "n 3"]:
    """Unit vectors with these z, each turned by the golden angle against the one before (Fibonacci's spiral).

    Spread evenly over the sphere where the heights are spread evenly from -1 to 1, or over a part of it.
    """
    turn = torch.arange(len(heights)) * _GOLDEN_ANGLE
    level = (1 - heights.square()).clamp_min(0).sqrt()
    return torch.stack([level * turn.cos(), level * turn.sin(), heights], -1)
