"""Body of a robot: points to sample densities at, and a solid to judge against a mesh.

Solids are closed meshes, read, checked, and filled with points. Densities are taken at points, and distances from the
surface, which is exact for boxes, meshes and unions of balls.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError, first_line
from nerfnav.robots.body_points import MOST_POINTS, place_points, push_of
from nerfnav.robots.state import RigidState
from nerfnav.robots.surface import BodySurface

if TYPE_CHECKING:
    import trimesh  # slow to import, and most bodies are boxes


_SMALLEST, _LARGEST = 0.005, 5.0
"""Longest edge of a body [m] below or above which its mesh is surely in other units."""


def solid_of(source: "trimesh.Trimesh | Path | str", spacing: float, hull: bool) -> "trimesh.Trimesh":
    """Make a closed mesh [m] of a mesh, a file, or the convex hull of either, around the middle of its bounding box.

    Raises InvalidInputError for what is no such mesh, is absurdly large, or has too many points `spacing` [m] apart.
    """
    if not spacing > 0:
        raise InvalidInputError(f"the spacing of body points must be above 0 m, not {spacing}")
    mesh = read_mesh(source) if isinstance(source, Path | str) else check_mesh(source)
    check_size(float(mesh.extents.max()))
    from scipy.spatial import QhullError  # slow to import

    try:
        mesh = (mesh.convex_hull if hull else mesh).copy()
    except QhullError as error:
        raise InvalidInputError("a body's mesh has no convex hull: it is flat, or a line") from error
    if not mesh.is_watertight:
        raise InvalidInputError("a body's mesh must be closed, or nothing is inside: close it, or take its hull")
    _check_count(mesh, spacing)
    mesh.apply_translation(-mesh.bounds.mean(0))
    if mesh.volume < 0:  # its faces look inwards
        mesh.invert()
    return mesh


def read_mesh(path: Path | str) -> "trimesh.Trimesh":
    """Read the mesh of a file, of any size. Raises InvalidInputError for a file that is none, or has no triangles."""
    import trimesh

    try:
        mesh = trimesh.load_mesh(path, process=False)  # which would leave out what is not finite
    except Exception as error:  # readers raise anything for a broken file
        raise InvalidInputError(f"{path} cannot be read as a mesh: {first_line(error)}") from error
    try:
        return check_mesh(mesh).process()
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: {error}") from error


def check_mesh(mesh: object) -> "trimesh.Trimesh":
    """Check that a mesh has triangles, between finite corners. Raises InvalidInputError."""
    import trimesh

    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise InvalidInputError("a body's mesh must have triangles, and this one has none")
    if not np.isfinite(mesh.vertices).all():
        raise InvalidInputError("the corners of a body's mesh must be finite numbers")
    return mesh


def check_size(longest: float) -> None:
    """Check the longest edge of a body [m]. Raises InvalidInputError for one that is in other units."""
    if not _SMALLEST <= longest <= _LARGEST:
        raise InvalidInputError(
            f"a body must be {_SMALLEST:g} to {_LARGEST:g} m long, not {longest:g} m: is it in other units?"
        )


def _check_count(mesh: "trimesh.Trimesh", spacing: float) -> None:
    """Refuse a body that would have too many points, before they are placed."""
    in_box = float(np.prod(mesh.extents / spacing + 1))
    in_solid = float(mesh.area / spacing**2 + mesh.volume / spacing**3)  # less for what fills little of its box
    if min(in_box, in_solid) > MOST_POINTS:
        raise InvalidInputError(
            f"a body {float(mesh.extents.max()):g} m long with points {spacing:g} m apart would have more than "
            f"{MOST_POINTS} of them: take a larger spacing"
        )


@dataclass(frozen=True)
class Body:
    """Body: a solid around its origin, and points that fill it."""

    extents: tuple[float, float, float]
    """Edge lengths along the body's x, y, z of the solid, or of the box around it [m]."""
    points_body: Float[Tensor, "b 3"]
    """Points of the body at which densities are taken [m]."""
    solid: "trimesh.Trimesh | None" = None
    """Its closed surface in the body's axes [m]; None: the whole box."""
    push: Float[Tensor, "b 3"] | None = None
    """Way of each point in a metre of growth, as thin parts need it; None: in proportion to the box."""
    balls: Float[Tensor, "k 4"] | None = None
    """Middles and radii [m] of the balls whose union the body is, and `solid` its mesh; None: it is no such union."""

    @classmethod
    def box(cls, extents: tuple[float, float, float], counts: tuple[int, int, int]) -> "Body":
        """Make a box filled with a regular grid of counts[0] x counts[1] x counts[2] points, faces included."""
        axes = [
            torch.linspace(-edge / 2, edge / 2, count) if count > 1 else torch.zeros(1)
            for edge, count in zip(extents, counts, strict=True)
        ]
        return cls(extents, torch.cartesian_prod(*axes))

    @classmethod
    def from_mesh(cls, source: "trimesh.Trimesh | Path | str", spacing: float = 0.02, *, hull: bool = False) -> "Body":
        """Make a body of any shape: a closed mesh [m], or a file of one, filled with points about `spacing` [m] apart,
        and closer in parts that are thinner than that.

        The middle of its bounding box becomes the body's origin; x is forward and z up. With `hull` the body is the
        mesh's convex hull, which any mesh has. Raises InvalidInputError for what is no such mesh, or absurdly large,
        or has a part thinner than 1 mm.
        """
        mesh = solid_of(source, spacing, hull)
        x, y, z = (float(edge) for edge in mesh.extents)
        found = place_points(mesh, spacing)
        push = None if found.push is None else torch.from_numpy(found.push).float()
        return cls((x, y, z), torch.from_numpy(found.points).float(), mesh, push)

    def points_at(self, states: RigidState) -> Float[Tensor, "*batch b 3"]:
        """Compute the places of its points in the world [m], at states of batch shape (*batch)."""
        points_body, batch = self.points_body.to(states.position), states.position.shape[:-1]
        # one large product: many of 3 x 3 take ten times as long
        turned = (states.rotation.reshape(-1, 3) @ points_body.mT).reshape(*batch, 3, len(points_body))
        return turned.mT.contiguous() + states.position[..., None, :]

    @cached_property
    def surface(self) -> BodySurface:
        """Its surface in the body's axes, from which distances are measured."""
        if self.balls is not None:
            return BodySurface.of_balls(self.balls.double().cpu().numpy())
        return BodySurface.of_box(self.extents) if self.solid is None else BodySurface.of_mesh(self.solid)

    def grown(self, margin: float, *, upright: bool = True) -> "Body":
        """Grow the body: every face of its box moves outwards by `margin` [m], and all else in proportion.

        Without `upright` top and bottom stay where they are. Of a body with thin parts all of the surface moves
        outwards by `margin`, or an arm would grow in length alone.
        """
        rise = margin if upright else 0.0
        x, y, z = (edge + 2 * more for edge, more in zip(self.extents, (margin, margin, rise), strict=True))
        if self.push is not None and self.solid is not None:
            more = torch.tensor([margin, margin, rise])
            solid = self.solid.copy()
            solid.vertices = solid.vertices + push_of(solid) * more.numpy()
            return Body((x, y, z), self.points_body + self.push * more, solid, self.push)
        stretch = torch.tensor([x, y, z]) / torch.tensor(self.extents)
        solid = None if self.solid is None else self.solid.copy().apply_scale(stretch.tolist())
        return Body((x, y, z), self.points_body * stretch.to(self.points_body), solid)

    @property
    def radius(self) -> float:
        """Return half of the box's diagonal [m]: the body fits into this ball in every attitude."""
        return 0.5 * sum(edge * edge for edge in self.extents) ** 0.5
