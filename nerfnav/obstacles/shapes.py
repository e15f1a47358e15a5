"""Shapes of obstacles around their own origin: box, sphere, cylinder, prism and closed mesh [m].

A shape gives the signed distance of points (negative inside), its support function, from which a box around it follows
in any frame, and a closed mesh. Distances outside are exact; inside a mesh and a prism too.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from nerfnav.core.errors import InvalidInputError, require_positive

if TYPE_CHECKING:
    import trimesh  # slow to import

    from nerfnav.obstacles.triangles import MeshDistance

Points = Float[np.ndarray, "n 3"]
Distances = Float[np.ndarray, " n"]

_SIDES = 48
"""Sides of the mesh of a cylinder."""
_FINENESS = 3
"""Subdivisions of the mesh of a sphere."""
LARGEST = 1000.0
"""Largest extent of a mesh file [m]: above it, it is in other units."""


@runtime_checkable
class Shape(Protocol):
    """Solid around its own origin, in its own axes."""

    def signed_distance(self, points: Points) -> Distances:
        """Distance of points from the surface [m], negative inside."""
        ...

    def support(self, directions: Points) -> Distances:
        """Largest projection of the shape onto each direction [m]: max over its points p of d . p."""
        ...

    def mesh(self) -> "trimesh.Trimesh":
        """Closed mesh of the surface [m]."""
        ...


@dataclass(frozen=True)
class BoxShape:
    """Box around its origin."""

    extents: tuple[float, float, float]
    """Edge lengths along x, y, z [m]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for an edge that is not above 0."""
        for name, edge in zip("xyz", self.extents, strict=True):
            require_positive(**{f"the edge of a box along {name}": edge})

    def signed_distance(self, points: Points) -> Distances:
        """Distance of points from the surface [m], negative inside."""
        gap = np.abs(points) - 0.5 * np.array(self.extents)
        return np.linalg.norm(gap.clip(0.0), axis=-1) + gap.max(-1).clip(max=0.0)

    def support(self, directions: Points) -> Distances:
        """Largest projection onto each direction [m]."""
        return np.abs(directions) @ (0.5 * np.array(self.extents))

    def mesh(self) -> "trimesh.Trimesh":
        """Closed mesh of 12 triangles."""
        import trimesh

        return trimesh.creation.box(self.extents)


@dataclass(frozen=True)
class Sphere:
    """Ball around its origin."""

    radius: float
    """[m]"""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a radius that is not above 0."""
        require_positive(**{"the radius of a sphere": self.radius})

    def signed_distance(self, points: Points) -> Distances:
        """Distance of points from the surface [m], negative inside."""
        return np.linalg.norm(points, axis=-1) - self.radius

    def support(self, directions: Points) -> Distances:
        """Largest projection onto each direction [m]."""
        return self.radius * np.linalg.norm(directions, axis=-1)

    def mesh(self) -> "trimesh.Trimesh":
        """Closed mesh of 1280 triangles."""
        import trimesh

        return trimesh.creation.icosphere(subdivisions=_FINENESS, radius=self.radius)


@dataclass(frozen=True)
class Cylinder:
    """Cylinder around its origin, its axis along z."""

    radius: float
    """[m]"""
    height: float
    """[m]"""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for lengths that are not above 0."""
        require_positive(**{"the radius of a cylinder": self.radius, "the height of a cylinder": self.height})

    def signed_distance(self, points: Points) -> Distances:
        """Distance of points from the surface [m], negative inside."""
        beside = np.linalg.norm(points[..., :2], axis=-1) - self.radius
        return _extruded(beside, np.abs(points[..., 2]) - 0.5 * self.height)

    def support(self, directions: Points) -> Distances:
        """Largest projection onto each direction [m]."""
        around = np.linalg.norm(directions[..., :2], axis=-1)
        return self.radius * around + 0.5 * self.height * np.abs(directions[..., 2])

    def mesh(self) -> "trimesh.Trimesh":
        """Closed mesh of 48 sides."""
        import trimesh

        return trimesh.creation.cylinder(self.radius, self.height, sections=_SIDES)


@dataclass(frozen=True)
class Prism:
    """Upright prism: a polygon in the x-y plane, between two heights."""

    polygon: tuple[tuple[float, float], ...]
    """Corners x, y in order [m], either way round."""
    heights: tuple[float, float]
    """Lower and upper z [m]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a polygon that crosses itself or has no area, and for heights without a gap."""
        corners = self._corners
        if len(corners) < 3 or not np.isfinite(corners).all():
            raise InvalidInputError(f"the polygon of a prism has at least 3 finite corners, not {len(corners)}")
        if not (math.isfinite(sum(self.heights)) and self.heights[0] < self.heights[1]):
            raise InvalidInputError(
                f"the heights of a prism are the lower and then the upper one, not {list(self.heights)}"
            )
        if _crosses_itself(corners):
            raise InvalidInputError("the polygon of a prism crosses itself: give its corners in order")
        after = np.roll(corners, -1, axis=0)
        if abs(_cross(corners, after).sum()) < 1e-9:
            raise InvalidInputError("the polygon of a prism has no area: give corners that are not on one line")

    @cached_property
    def _corners(self) -> Float[np.ndarray, "c 2"]:
        return np.array(self.polygon, float).reshape(-1, 2)

    def signed_distance(self, points: Points) -> Distances:
        """Distance of points from the surface [m], negative inside."""
        lower, upper = self.heights
        above = np.abs(points[..., 2] - 0.5 * (lower + upper)) - 0.5 * (upper - lower)
        return _extruded(_distance_from_polygon(self._corners, points[..., :2]), above)

    def support(self, directions: Points) -> Distances:
        """Largest projection onto each direction [m]."""
        upright = np.maximum(directions[..., 2] * self.heights[0], directions[..., 2] * self.heights[1])
        return (directions[..., :2] @ self._corners.T).max(-1) + upright

    def mesh(self) -> "trimesh.Trimesh":
        """Closed mesh of the prism."""
        import trimesh
        from manifold3d import CrossSection, FillRule, Manifold

        section = CrossSection([self._corners], FillRule.EvenOdd)
        solid = Manifold.extrude(section, self.heights[1] - self.heights[0]).translate((0.0, 0.0, self.heights[0]))
        found = solid.to_mesh64()
        return trimesh.Trimesh(np.array(found.vert_properties), np.array(found.tri_verts), process=False)


@dataclass(frozen=True, eq=False)
class MeshShape:
    """Solid inside a closed mesh."""

    surface: "trimesh.Trimesh"
    """Its surface [m]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a mesh that is open, has no volume, or is in other units."""
        if not self.surface.is_watertight:
            raise InvalidInputError("the mesh of an obstacle is open, so nothing is inside: close it")
        longest = float(self.surface.extents.max())
        if abs(self.surface.volume) < 1e-12 or longest > LARGEST:
            raise InvalidInputError(
                f"the mesh of an obstacle encloses a volume and is at most {LARGEST:g} m long; this one is "
                f"{longest:.3g} m long with {abs(self.surface.volume):.3g} m^3"
            )

    def signed_distance(self, points: Points) -> Distances:
        """Distance of points from the surface [m], negative inside."""
        return self._distance.signed(points)

    @cached_property
    def _distance(self) -> "MeshDistance":
        from nerfnav.obstacles.triangles import MeshDistance  # slow to import, and most obstacles are no meshes

        return MeshDistance(self.surface)

    def support(self, directions: Points) -> Distances:
        """Largest projection onto each direction [m]."""
        return (directions @ np.asarray(self.surface.vertices, float).T).max(-1)

    def mesh(self) -> "trimesh.Trimesh":
        """Closed mesh, a copy."""
        return self.surface.copy()


def _extruded(beside: Distances, above: Distances) -> Distances:
    """Signed distance from a solid whose section has the signed distance `beside`, and whose ends `above`."""
    outside = np.hypot(beside.clip(0.0), above.clip(0.0))
    return outside + np.maximum(beside, above).clip(max=0.0)


def _distance_from_polygon(corners: Float[np.ndarray, "c 2"], points: Float[np.ndarray, "n 2"]) -> Distances:
    """Signed distance of points from a simple polygon, negative inside (crossing number)."""
    a, b = corners, np.roll(corners, -1, axis=0)
    edge, to = b - a, points[:, None] - a
    share = ((to * edge).sum(-1) / np.maximum((edge * edge).sum(-1), 1e-300)).clip(0.0, 1.0)
    distance = np.linalg.norm(to - share[..., None] * edge, axis=-1).min(1)
    y = points[:, None, 1]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(edge[:, 1] == 0.0, 1.0, edge[:, 1])
    left = points[:, None, 0] < a[:, 0] + edge[:, 0] * (y - a[:, 1]) / rise
    inside = ((spans & left).sum(1) % 2).astype(bool)
    return np.where(inside, -distance, distance)


def _cross(a: Float[np.ndarray, "*batch 2"], b: Float[np.ndarray, "*batch 2"]) -> Float[np.ndarray, "*batch"]:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _crosses_itself(corners: Float[np.ndarray, "c 2"]) -> bool:
    """Check for two edges that cross, or a corner that stands on another edge."""
    count, after = len(corners), np.roll(corners, -1, axis=0)
    first, second = np.triu_indices(count, 1)
    apart = (second - first > 1) & ~((first == 0) & (second == count - 1))
    first, second = first[apart], second[apart]
    a, b, c, d = corners[first], after[first], corners[second], after[second]

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        return np.sign(_cross(q - p, r - p))

    meets = (side(a, b, c) * side(a, b, d) <= 0) & (side(c, d, a) * side(c, d, b) <= 0)
    overlaps = (np.minimum(a, b) <= np.maximum(c, d)).all(-1) & (np.minimum(c, d) <= np.maximum(a, b)).all(-1)
    doubled = (corners == after).all(-1).any()
    return bool(doubled or (meets & overlaps).any())
