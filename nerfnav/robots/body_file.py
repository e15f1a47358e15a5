"""Shape of a robot in its file [m]: box, cylinder, spheres, mesh or URDF. One of:

    box: [0.25, 0.25, 0.08]                       # edge lengths along x (forward), y, z (up)
    cylinder: {radius: 0.2, height: 0.1}          # upright
    spheres: [[0, 0, 0, 0.1], [0.2, 0, 0, 0.05]]  # x, y, z, radius
    mesh: hull.stl                                # beside the file; closed, or its convex hull with `hull: true`
    urdf: robot.urdf                              # the convex hull of its collision geometry

All but a box have their origin in the middle of their bounding box. `spacing` says how far apart the points are at
which densities are taken, at most: in parts thinner than that (arms, rods, plates, small spheres) they are as close as
the thickness asks. A box may give their number along each edge: `points: [6, 6, 3]`. Parts are at least 1 mm thick.
"""

import logging
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import msgspec
import numpy as np
import torch
from jaxtyping import Float

from nerfnav.core.errors import InvalidInputError, first_line
from nerfnav.core.extras import import_extra
from nerfnav.robots.body import Body, check_mesh, check_size, read_mesh
from nerfnav.robots.body_points import FINEST, FOURTH, MANY, MOST_POINTS, THINNEST

if TYPE_CHECKING:
    import trimesh

Vector = tuple[float, float, float]
_SIDES, _MANY = 32, 3000
"""Sides of a cylinder, and body points that are many."""
_SMALL = 0.1
"""Radius [m] up to which 320 triangles follow a sphere to 1 mm; larger ones have 1280."""


class Cylinder(msgspec.Struct, forbid_unknown_fields=True):
    """Upright cylinder around the body's origin."""

    radius: float
    height: float


class BodyFile(msgspec.Struct, forbid_unknown_fields=True):
    """Entry `body` of a robot's file."""

    box: Vector | None = None
    cylinder: Cylinder | None = None
    spheres: list[tuple[float, float, float, float]] | None = None
    mesh: str | None = None
    urdf: str | None = None
    points: tuple[int, int, int] | None = None
    spacing: float | None = None
    hull: bool = False


def body_of(entry: BodyFile, folder: Path) -> tuple[Body, tuple[int, int, int]]:
    """The body, and how many of its points lie along each edge of the box around it; meshes lie in `folder`.

    Raises InvalidInputError for a shape that is none.
    """
    shapes = {name: getattr(entry, name) for name in ("box", "cylinder", "spheres", "mesh", "urdf")}
    given = {name: shape for name, shape in shapes.items() if shape is not None}
    if len(given) != 1:
        raise InvalidInputError(f"a body is one of {', '.join(shapes)}, and this one has {len(given)} of them")
    if entry.box is not None:
        _check_thickness("box", *entry.box)
        check_size(max(entry.box))
        spacing = _spacing_in(entry.box) if entry.spacing is None else entry.spacing
        counts = entry.points or _counts(entry.box, spacing)
        if min(counts) < 1 or math.prod(counts) > MOST_POINTS:
            raise InvalidInputError(
                f"the points of a body are at least 1 along an edge and at most {MOST_POINTS}, not {counts}"
            )
        return Body.box(entry.box, counts), counts
    if entry.points is not None:
        raise InvalidInputError("points are counted along the edges of a box: give a spacing")
    mesh, hull = _mesh_of(entry, folder)
    spacing = spacing_for(tuple(mesh.extents)) if entry.spacing is None else entry.spacing
    body = Body.from_mesh(mesh, spacing, hull=hull)
    if entry.spheres is not None:
        body = replace(body, balls=_balls(entry.spheres))
    return body, _counts(body.extents, spacing)


def spacing_for(extents: Vector) -> float:
    """Distance between body points [m] that suits a size: 2.5 cm at 10 cm, 5 cm at 25 cm, then 8 cm.

    More in bodies of metres, which would have more points than planning can ask about.
    """
    longest = max(extents)
    return max(min(max(0.2 * longest, min(0.25 * longest, 0.025)), 0.08), (math.prod(extents) / _MANY) ** (1 / 3))


def _spacing_in(box: Vector) -> float:
    """Distance between the points of a box [m]: of one thinner than suits its size, as its thickness asks."""
    usual, (x, y, z) = spacing_for(box), box
    if min(box) >= usual:
        return usual
    affordable = (2 * (x * y + y * z + z * x) / MANY) ** 0.5
    return min(usual, max(FINEST, FOURTH * min(box), affordable))


def _balls(spheres: list[tuple[float, float, float, float]]) -> torch.Tensor:
    """Collect spheres as (k, 4), around the middle of the box around them."""
    balls = np.array(spheres, float)
    balls[:, :3] -= 0.5 * _corners(spheres).sum(0)
    return torch.from_numpy(balls)


def _corners(spheres: list[tuple[float, float, float, float]]) -> Float[np.ndarray, "2 3"]:
    """Lower and upper corner of the box around spheres [m]."""
    balls = np.array(spheres, float)
    middle, radius = balls[:, :3], balls[:, 3:]
    return np.stack([(middle - radius).min(0), (middle + radius).max(0)])


def _counts(extents: Vector, spacing: float) -> tuple[int, int, int]:
    _check_lengths("spacing", spacing)
    x, y, z = (max(2, math.ceil(edge / spacing - 1e-6) + 1) for edge in extents)
    return x, y, z


def _mesh_of(entry: BodyFile, folder: Path) -> "tuple[trimesh.Trimesh, bool]":
    """The closed surface, and whether its convex hull is wanted."""
    import trimesh

    if entry.cylinder is not None:
        _check_thickness("cylinder", 2 * entry.cylinder.radius, entry.cylinder.height)
        check_size(max(2 * entry.cylinder.radius, entry.cylinder.height))
        return trimesh.creation.cylinder(entry.cylinder.radius, entry.cylinder.height, sections=_SIDES), False
    if entry.spheres is not None:
        return _union(entry.spheres), False
    if entry.mesh is not None:
        path = folder / entry.mesh
        if not path.is_file():
            raise InvalidInputError(f"there is no mesh {path}")
        return read_mesh(path), entry.hull
    return _collision_geometry(folder / str(entry.urdf)), True


def _union(spheres: list[tuple[float, float, float, float]]) -> "trimesh.Trimesh":
    import trimesh

    if not spheres:
        raise InvalidInputError("a body of spheres has at least one: [x, y, z, radius]")
    for *middle, radius in spheres:
        _check_thickness("sphere", 2 * radius)
        _check_lengths("sphere", *(abs(number) + radius for number in middle))
    check_size(float(np.ptp(_corners(spheres), axis=0).max()))  # before the union, which far ones have no mesh for
    balls = []
    for *middle, radius in spheres:
        fineness = 2 if radius <= _SMALL else 3
        balls.append(trimesh.creation.icosphere(subdivisions=fineness, radius=radius).apply_translation(middle))
    return balls[0] if len(balls) == 1 else trimesh.boolean.union(balls)


_URDF_SHAPES = ("box", "cylinder", "sphere", "mesh")


def _collision_geometry(path: Path) -> "trimesh.Trimesh":
    """All collision meshes and primitives of a URDF, its joints at zero."""
    yourdfpy = import_extra("yourdfpy", "urdf", "a body from a URDF")
    if not path.is_file():
        raise InvalidInputError(f"there is no URDF {path}")
    try:
        shapes = ElementTree.parse(path).findall(".//collision/geometry/*")
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise InvalidInputError(f"{path} cannot be read as a URDF: {first_line(error)}") from error
    for shape in shapes:  # yourdfpy leaves out what it does not know or find
        if shape.tag not in _URDF_SHAPES:
            known = ", ".join(_URDF_SHAPES)
            raise InvalidInputError(f"{path} has a collision geometry {shape.tag!r}; known are {known}")
        if shape.tag == "mesh":
            read_mesh(yourdfpy.filename_handler_magic(shape.get("filename", ""), dir=str(path.parent)))
    logging.getLogger("yourdfpy").addHandler(logging.NullHandler())  # what it complains of is refused here
    try:
        urdf = yourdfpy.URDF.load(str(path), build_scene_graph=False, load_meshes=False,
                                  build_collision_scene_graph=True, load_collision_meshes=True)  # fmt: skip
        scene = urdf.collision_scene
        mesh = scene.to_geometry() if scene is not None and scene.geometry else None
    except Exception as error:  # readers raise anything for a broken file
        raise InvalidInputError(f"{path} cannot be read as a URDF: {first_line(error)}") from error
    if mesh is None:
        raise InvalidInputError(f"{path} has no collision geometry: give the body as a box")
    try:
        return check_mesh(mesh)
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: {error}") from error


def _check_lengths(what: str, *lengths: float) -> None:
    if not all(0 < length < math.inf for length in lengths):
        raise InvalidInputError(f"the lengths of a {what} are above 0 m")


def _check_thickness(what: str, *lengths: float) -> None:
    _check_lengths(what, *lengths)
    if min(lengths) < THINNEST:
        raise InvalidInputError(f"a {what} is at least 1 mm thick, not {1000 * min(lengths):.2g} mm: lengths are in m")
