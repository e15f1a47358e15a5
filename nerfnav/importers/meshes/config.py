"""Configuration of the import of a mesh."""

from dataclasses import dataclass, field
from typing import Literal

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.placement import Placement


@dataclass(frozen=True)
class MeshOptions:
    """Options that a mesh file may leave open; None: guess."""

    units: Literal["m", "cm", "mm", "in", "ft"] | None = None
    """Unit of a mesh's lengths, in place of a scale."""
    seen_from: Literal["inside", "outside"] | None = None
    """Room that is photographed from inside, or open ground."""


@dataclass(frozen=True)
class SceneConfig:
    """Options of the conversion of a mesh to a place."""

    placement: Placement = field(default_factory=Placement)
    """Placement of the mesh in the world. Without a box the field holds all of the mesh, and air over open ground."""
    options: MeshOptions = field(default_factory=MeshOptions)
    """Options of meshes alone."""
    voxel: float | None = None
    """Size of voxels [m]; None: so that the box has `nodes` of them."""
    nodes: float = 6e6
    """Nodes of the field: what a minute or two can train."""
    aside: float = 0.05
    """Free space beside open ground, in longest edges of the mesh."""
    headroom: float = 0.25
    """Free space above it, in heights of the mesh, but not less than `aside`."""
    below: float = 2.0
    """Space below and, in a room, around the mesh [voxels]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError where lengths are given twice."""
        if self.options.units is not None and self.placement.meters_per_unit is not None:
            raise InvalidInputError("give either units or a scale, not both")
