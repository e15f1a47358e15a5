"""What a robot's body is made of: points to sample densities at, and a solid to judge against a mesh."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.robots.solid import filling, solid_of
from nerfnav.robots.state import RigidState

if TYPE_CHECKING:
    import trimesh  # slow to import, and most bodies are boxes


@dataclass(frozen=True)
class Body:
    """A solid around the body's origin, and points that fill it."""

    extents: tuple[float, float, float]
    """Edge lengths along the body's x, y, z of the solid, or of the box around it [m]."""
    points_body: Float[Tensor, "b 3"]
    """Points of the body at which density is asked for [m]."""
    solid: "trimesh.Trimesh | None" = None
    """Its closed surface in the body's axes [m]; None: the whole box."""

    @classmethod
    def box(cls, extents: tuple[float, float, float], counts: tuple[int, int, int]) -> "Body":
        """A box filled with a regular grid of counts[0] x counts[1] x counts[2] points, faces included."""
        axes = [
            torch.linspace(-edge / 2, edge / 2, count) if count > 1 else torch.zeros(1)
            for edge, count in zip(extents, counts, strict=True)
        ]
        return cls(extents, torch.cartesian_prod(*axes))

    @classmethod
    def from_mesh(cls, source: "trimesh.Trimesh | Path | str", spacing: float = 0.02, *, hull: bool = False) -> "Body":
        """A body of any shape: a closed mesh [m], or a file of one, filled with points about `spacing` [m] apart.

        The middle of its bounding box becomes the body's origin; x is forward and z up. With `hull` the body is the
        mesh's convex hull, which any mesh has. Raises InvalidInputError for what is no such mesh, or absurdly large.
        """
        mesh = solid_of(source, spacing, hull)
        x, y, z = (float(edge) for edge in mesh.extents)
        return cls((x, y, z), torch.from_numpy(filling(mesh, spacing)).float(), mesh)

    def points_at(self, states: RigidState) -> Float[Tensor, "*batch b 3"]:
        """Where its points are in the world [m], at states of batch shape (*batch)."""
        points_body = self.points_body.to(states.position)
        return points_body @ states.rotation.transpose(-1, -2) + states.position[..., None, :]

    def grown(self, margin: float, *, upright: bool = True) -> "Body":
        """The same body with every face of its box moved outwards by `margin` [m], all else spread accordingly.

        Without `upright` top and bottom stay where they are.
        """
        rise = margin if upright else 0.0
        x, y, z = (edge + 2 * more for edge, more in zip(self.extents, (margin, margin, rise), strict=True))
        stretch = torch.tensor([x, y, z]) / torch.tensor(self.extents)
        solid = None if self.solid is None else self.solid.copy().apply_scale(stretch.tolist())
        return Body((x, y, z), self.points_body * stretch.to(self.points_body), solid)

    @property
    def radius(self) -> float:
        """Half of the box's diagonal [m]: the body fits into this ball in every attitude."""
        return 0.5 * sum(edge * edge for edge in self.extents) ** 0.5
