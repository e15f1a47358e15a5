"""Occupancy states of nodes: proven free, solid, or unproven (the proofs are in nerfnav/field/proof).

A map that takes for free what nobody has proven free leads through plain walls: colours alone do not tell a plain
wall from fog before it, behind it, or nowhere. So there are three states, and planners take the third for solid.
"""

import math
from enum import IntEnum

import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

DENSITY_SCALE = 400.0
"""rho = DENSITY_SCALE softplus(raw) [1/m]: density at a raw value of 0.54; large, so that a surface is opaque within a
voxel or two."""
EMPTY_RAW = -20.0
"""Raw density of empty nodes: rho below 1e-6 / m."""
SOLID_RAW = -2.0
"""Raw density of what is taken for solid: 51 / m, as stones have at least. Between such a node and an empty one, space
counts as solid for an eighth of the way: maps do not grow much beyond what is unproven."""
SOLID_DENSITY = 5.0
"""Density above which a place counts as solid [1/m]: a body of 10 cm in there would be hit with a chance of 40 %.
Stones have 50 and more, fog less than 1."""
PAPERS_GRAIN = 0.0171
"""Distance of nodes in places of the paper's scale [m], at most: those of the bundled worlds of two to three metres."""
VOXELS_IN_UNIT = 77
"""Voxels in the length that densities are weighed in: a metre for the voxels of the paper's Stonehenge."""

States = UInt8[Tensor, "nx ny nz"]


class State(IntEnum):
    """What is known of a node. Numbers are those in files."""

    FREE = 0
    """Light was seen to pass it: nothing stands there."""
    SOLID = 1
    """Something stands there, as the field says."""
    UNPROVEN = 2
    """Neither is proven."""


def classify_nodes(free: Bool[Tensor, "nx ny nz"], raw: Float[Tensor, "nx ny nz"]) -> States:
    """The states of nodes with raw densities, of which some are proven `free`."""
    solid = torch.where(raw > raw_of(SOLID_DENSITY), int(State.SOLID), int(State.UNPROVEN))
    return torch.where(free, int(State.FREE), solid).to(torch.uint8)


def classify_unseen(unseen: Bool[Tensor, "nx ny nz"], raw: Float[Tensor, "nx ny nz"]) -> States:
    """The states of a field that only knows which nodes no camera saw: everything else is as it says."""
    as_it_says = torch.where(raw > EMPTY_RAW, int(State.SOLID), int(State.FREE))
    return torch.where(unseen, int(State.UNPROVEN), as_it_says).to(torch.uint8)


def planned_raw(
    raw: Float[Tensor, "*nodes"], states: UInt8[Tensor, "*nodes"], unproven_is_free: bool
) -> Float[Tensor, "*nodes"]:
    """Raw densities as planners take them: nothing where that is proven, and something solid where nothing is."""
    planned = torch.where(states == State.FREE, EMPTY_RAW, raw)
    if unproven_is_free:
        return planned
    return torch.where(states == State.UNPROVEN, planned.clamp_min(SOLID_RAW), planned)


def raw_of(density: float) -> float:
    """The raw value that stands for a density [1/m]: the inverse of scale * softplus."""
    return math.log(math.expm1(density / DENSITY_SCALE))


def density_of(raw: float) -> float:
    """The density that a raw value stands for [1/m]."""
    return DENSITY_SCALE * math.log1p(math.exp(raw))


def solid_density(spacing: float) -> float:
    """Density above which planners take a place for solid in a grid of nodes `spacing` [m] apart [1/m].

    SOLID_DENSITY in places of the paper's scale, and less in coarser ones, as the density of a wall one voxel thick is.
    """
    return SOLID_DENSITY * min(1.0, PAPERS_GRAIN / spacing)
