"""A part of a place: a shape and what it is made of."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import trimesh

from nerfnav_scenes.light import Light, lit
from nerfnav_scenes.primitives import EDGE, Size, box, place

Finish = Callable[[np.ndarray], np.ndarray]
"""Points (n, 3) on a part in its own frame to linear colours (n, 3)."""


@dataclass(frozen=True)
class Part:
    """A watertight shape with colours."""

    mesh: trimesh.Trimesh
    """Pose of the part."""
    albedo: np.ndarray
    """Linear colours (v, 3) of its vertices, before any light."""
    glass: bool = False
    """Light falls through it."""

    @classmethod
    def of(cls, mesh: trimesh.Trimesh, finish: Finish, glass: bool = False) -> "Part":
        """A shape, coloured in its own frame."""
        return cls(mesh, finish(mesh.vertices), glass)

    def placed(self, position: Size, yaw: float = 0.0, tilt: tuple[float, float] = (0.0, 0.0)) -> "Part":
        """The part where `primitives.place` puts its shape."""
        return Part(place(self.mesh.copy(), position, yaw, tilt), self.albedo, self.glass)


def slab(size: Size, finish: Finish) -> Part:
    """A box of `size` [m] around the origin, as finely tessellated as its place."""
    return Part.of(box(size, EDGE), finish)


def joined(parts: Iterable[Part], light: Light) -> tuple[trimesh.Trimesh, tuple[trimesh.Trimesh, ...]]:
    """Join parts under a light into the visible mesh and the solids for contact."""
    ordered = sorted(parts, key=lambda part: part.glass)
    meshes = [part.mesh for part in ordered]
    seen = lit(meshes, [part.albedo for part in ordered], light, sum(part.glass for part in ordered))
    return seen, tuple(meshes)
