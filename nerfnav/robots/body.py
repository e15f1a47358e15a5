"""What a robot's body is made of: points to sample densities at, and a solid to judge against a mesh."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True)
class Body:
    """A solid box around the body's origin, and points that fill it."""

    extents: tuple[float, float, float]
    """Edge lengths along the body's x, y, z [m]."""
    points_body: Float[Tensor, "b 3"]
    """Points of the body at which density is asked for [m]."""

    @classmethod
    def box(cls, extents: tuple[float, float, float], counts: tuple[int, int, int]) -> "Body":
        """A box filled with a regular grid of counts[0] x counts[1] x counts[2] points, faces included."""
        axes = [
            torch.linspace(-edge / 2, edge / 2, count) if count > 1 else torch.zeros(1)
            for edge, count in zip(extents, counts, strict=True)
        ]
        return cls(extents, torch.cartesian_prod(*axes))

    def grown(self, margin: float) -> "Body":
        """The same body with every face moved outwards by `margin` [m], its points spread accordingly."""
        x, y, z = (edge + 2 * margin for edge in self.extents)
        stretch = torch.tensor([x, y, z]) / torch.tensor(self.extents)
        return Body((x, y, z), self.points_body * stretch.to(self.points_body))

    @property
    def radius(self) -> float:
        """Half of the box's diagonal [m]: the body fits into this ball in every attitude."""
        return 0.5 * sum(edge * edge for edge in self.extents) ** 0.5
