"""Occupancy: free, solid or unproven, of nodes and voxels, and the field as planners take it.

A map that takes unproven space for free leads through plain walls: colours alone do not distinguish a plain wall from
fog before it, behind it, or nowhere. So there are three states, and planners take the third for solid unless
`UnknownSpace` says otherwise. The proofs are in nerfnav/field/proof.
"""

import math
from enum import Enum, IntEnum
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nerfnav.field.core.protocol import Field

DENSITY_SCALE = 400.0
"""rho = DENSITY_SCALE softplus(raw) [1/m]: density at a raw value of 0.54; large, so that a surface is opaque within a
voxel or two."""
EMPTY_RAW = -20.0
"""Raw density of empty nodes: rho below 1e-6 / m."""
SOLID_RAW = -2.0
"""Raw density of unproven nodes for planners: 51 / m, as stones have at least. Between such a node and an empty one,
space counts as solid for an eighth of the distance: maps do not grow much beyond what is unproven."""
SOLID_DENSITY = 5.0
"""Density above which a place counts as solid [1/m]: a body of 10 cm in there would be hit with a chance of 40 %.
Stones have 50 and more, fog less than 1."""
PAPERS_GRAIN = 0.0171
"""Distance of nodes in places of the paper's scale [m], at most: those of the bundled worlds of two to three metres."""
VOXELS_IN_UNIT = 77
"""Voxels in the length that densities are weighed in: a metre for the voxels of the paper's Stonehenge."""

States = UInt8[Tensor, "nx ny nz"]


class Occupancy(IntEnum):
    """State of a node or voxel. Numbers are those in files."""

    FREE = 0
    """Proven free: light was seen to pass it."""
    SOLID = 1
    """Solid, as the field says."""
    UNPROVEN = 2
    """Neither is proven."""


class UnknownSpace(Enum):
    """Assumption of planners about unproven space."""

    OCCUPIED = "occupied"
    """Solid: a hollow stone is no corridor, and a plain wall may be anywhere."""
    FREE = "free"
    """As the field says."""


@runtime_checkable
class HasOccupancy(Protocol):
    """A field that knows what is proven of its space, or has parts that do."""

    def planning_view(self, unknown: UnknownSpace) -> Field:
        """Return the field as planners take it; the field itself where occupancy was never determined."""
        ...


def planning_field(field: Field, unknown: UnknownSpace) -> Field:
    """Return the field to plan in: empty where that is proven, unproven nodes solid or as the field says.

    Made once for each field. Fields without occupancy stay as they are; composite fields are changed part by part.
    """
    return field.planning_view(unknown) if isinstance(field, HasOccupancy) else field


def unproven_shares(field: Field) -> Float[Tensor, " nz"] | None:
    """Share of unproven nodes at each height of a field; None where occupancy was never determined."""
    return getattr(field, "unproven_by_height", None)


def classify_nodes(free: Bool[Tensor, "nx ny nz"], raw: Float[Tensor, "nx ny nz"]) -> States:
    """Classify nodes by their raw densities and by which of them are proven `free`."""
    solid = torch.where(raw > raw_of(SOLID_DENSITY), int(Occupancy.SOLID), int(Occupancy.UNPROVEN))
    return torch.where(free, int(Occupancy.FREE), solid).to(torch.uint8)


def classify_unseen(unseen: Bool[Tensor, "nx ny nz"], raw: Float[Tensor, "nx ny nz"]) -> States:
    """Classify the nodes of a field that only knows which of them no camera saw: all others are as it says."""
    as_it_says = torch.where(raw > EMPTY_RAW, int(Occupancy.SOLID), int(Occupancy.FREE))
    return torch.where(unseen, int(Occupancy.UNPROVEN), as_it_says).to(torch.uint8)


def planning_raw(
    raw: Float[Tensor, "*nodes"], states: UInt8[Tensor, "*nodes"], unknown: UnknownSpace
) -> Float[Tensor, "*nodes"]:
    """Raw densities as planners take them: empty where that is proven, solid where nothing is."""
    planned = torch.where(states == Occupancy.FREE, EMPTY_RAW, raw)
    if unknown is UnknownSpace.FREE:
        return planned
    return torch.where(states == Occupancy.UNPROVEN, planned.clamp_min(SOLID_RAW), planned)


def raw_of(density: float) -> float:
    """Raw value of a density [1/m]: the inverse of scale * softplus."""
    return math.log(math.expm1(density / DENSITY_SCALE))


def inverse_softplus(values: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """x with softplus(x) = values > 0, in double precision."""
    values = values.double()
    return values + torch.log(-torch.expm1(-values))


def density_of(raw: float) -> float:
    """Density of a raw value [1/m]."""
    return DENSITY_SCALE * math.log1p(math.exp(raw))


def solid_density(spacing: float) -> float:
    """Density above which planners take a place for solid in a grid of nodes `spacing` [m] apart [1/m].

    SOLID_DENSITY in places of the paper's scale, and less in coarser ones, as the density of a wall one voxel thick is.
    """
    return SOLID_DENSITY * min(1.0, PAPERS_GRAIN / spacing)
