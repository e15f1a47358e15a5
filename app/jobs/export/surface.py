"""Isosurface of a place's field, as viewers show it."""

from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Float32, Int, Int32

from nerfnav.core.steps import run_steps
from nerfnav.field import GridField, field_mesh, open_rooms
from nerfnav.field.surface.texture import texture_mesh
from nerfnav_app.places.kept_surface import keep_surface, kept_surface
from nerfnav_app.places.place import Place
from nerfnav_app.places.surface_glb import encode_colored_glb, encode_textured_glb, remove_specks, simplified

if TYPE_CHECKING:
    import trimesh

    from nerfnav.world import Paint, Scene

_CELLS = 140
"""Cells of the surface along the longest edge of the box: finer ones cost the browser more than they show."""
_LEVEL, _DEPTH = 15.0, 0.3
"""Density at the surface [1/m], or this optical depth of a voxel where that is less: low enough that thin parts have
no holes, high enough that fog is not seen."""

_SPECK = 400
"""Parts of the surface with fewer faces than this are not shown."""


def build_surface(place: Place) -> bytes:
    """Surface of the field for viewers, as unlit binary glTF with a texture; made once for each field on this machine.

    Empty where the field has nothing dense, such as one that was hardly trained.
    """
    return run_steps(shape_surface(place))


def shape_surface(place: Place) -> Generator[None, None, bytes]:
    """Return `build_surface` a place; yields now and then, for it takes seconds."""
    file = _file(place)
    if file is not None and (kept := kept_surface(file)) is not None:
        return kept
    mesh, shaped = simplified(_mesh(place)), b""
    if len(mesh.faces):
        yield
        painted = yield from texture_mesh(place.field, mesh, _voxel(place))
        yield
        shaped = encode_textured_glb(painted, _box(place))
    if file is not None:
        keep_surface(file, shaped)
    return shaped


def build_first_surface(place: Place) -> tuple[bytes, bool]:
    """Surface of the field that is ready at once, and whether it is rough: with colours, without a texture."""
    file = _file(place)
    if file is not None and (kept := kept_surface(file)) is not None:
        return kept, False
    mesh = _mesh(place)
    return (encode_colored_glb(mesh, _box(place)), True) if len(mesh.faces) else (b"", False)


_EDGE, _MOST_FACES = 60, 200_000
"""Edges of a mesh's faces along the longest edge of its box, so that their corners show textures, and faces above which
they are fine enough."""


def encode_scene(scene: "Scene") -> bytes:
    """Mesh of a scene for viewers, in its colours at corners: quick enough to be shown before its field is made."""
    import trimesh

    from nerfnav.world import paint_of

    triangles = np.asarray(scene.mesh.triangles)
    edge = float(scene.box.size.max()) / _EDGE if len(triangles) < _MOST_FACES else np.inf
    face, weights, faces = divide_triangles(triangles, edge)
    colors = nearest_colors(scene.paint or paint_of(scene.mesh), face, weights).round().astype(np.uint8)
    corners = np.einsum("nk,nki->ni", weights, triangles[face])
    lower, upper = scene.box.lower.tolist(), scene.box.upper.tolist()
    return encode_colored_glb(trimesh.Trimesh(corners, faces, vertex_colors=colors, process=False), (lower, upper))


def nearest_colors(
    paint: "Paint", face: Int32[np.ndarray, " n"], weights: Float32[np.ndarray, "n 3"]
) -> Float32[np.ndarray, "n 3"]:
    """sRGB, 0 to 255, at points given by their face and their weights of its corners; of textures the nearest pixel.

    Renderers blend pixels, by kernels that take as long to load as the mesh takes to read.
    """
    colors = np.einsum("nk,nkc->nc", weights, paint.tint[face].astype(np.float32))
    image_of_point = paint.image_of_face[face]
    for index in np.unique(image_of_point[image_of_point >= 0]):
        here, image = image_of_point == index, paint.images[index]
        height, width = image.shape[:2]
        u, v = np.einsum("nk,nkc->cn", weights[here], paint.uv[face[here]])
        column, row = (np.floor(x).astype(int) for x in (u * width, (1 - v) * height))
        colors[here] *= image[row % height, column % width] / np.float32(255)
    return colors


def divide_triangles(
    triangles: Float[np.ndarray, "f 3 3"], edge: float
) -> tuple[Int32[np.ndarray, " n"], Float32[np.ndarray, "n 3"], Int[np.ndarray, "m 3"]]:
    """Divide triangles [m] evenly, each into as many that no edge is longer than `edge` [m].

    Returns the new corners, by their triangle and their weights of its three corners, and the new triangles, by their
    new corners; two triangles share none.
    """
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=-1).max(1, initial=0.0)
    counts = np.maximum(np.ceil(longest / edge), 1).astype(int)
    origins, weights, faces, begun = [], [], [], 0
    for count in np.unique(counts):
        among, (own, parts) = np.flatnonzero(counts == count), _lattice(count)
        first = begun + len(own) * np.arange(len(among))
        origins.append(np.repeat(among, len(own)).astype(np.int32))
        weights.append(np.tile(own, (len(among), 1)))
        faces.append((first[:, None, None] + parts).reshape(-1, 3))
        begun += len(own) * len(among)
    return np.concatenate(origins), np.concatenate(weights), np.concatenate(faces)


def _lattice(count: int) -> tuple[Float32[np.ndarray, "n 3"], Int[np.ndarray, "m 3"]]:
    """Weights of the points that divide each edge of a triangle into `count`, and the triangles between them."""
    i, j = np.indices((count + 1, count + 1)).reshape(2, -1)
    i, j = i[i + j <= count], j[i + j <= count]
    number = np.zeros((count + 2, count + 2), int)
    number[i, j] = np.arange(len(i))
    upright = np.stack([number[i, j], number[i + 1, j], number[i, j + 1]], -1)[i + j < count]
    inverted = np.stack([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]], -1)[i + j < count - 1]
    weights = (np.stack([count - i - j, i, j], -1) / count).astype(np.float32)
    return weights, np.concatenate([upright, inverted])


def _mesh(place: Place) -> "trimesh.Trimesh":
    field, spacing = place.field, float(place.field.box.size.max()) / _CELLS
    mesh = field_mesh(field, spacing, min(_LEVEL, _DEPTH / _voxel(place)))
    if isinstance(field, GridField) and field.info.proven_from in ("depth", "mesh"):
        mesh = open_rooms(field, mesh, spacing)
    return remove_specks(mesh, _SPECK)


def _box(place: Place) -> tuple[list[float], list[float]]:
    """Its lower and its upper corner [m]."""
    box = place.field.box
    return box.lower.tolist(), box.upper.tolist()


def _file(place: Place) -> Path | None:
    """The file that the surface is kept for; None for other fields than grids, and for one with obstacles in it, whose
    surface is shaped each time."""
    return place.file if isinstance(place.field, GridField) and place.obstacles is None else None


def _voxel(place: Place) -> float:
    """Resolution of the field [m]."""
    field = place.field
    return field.spacing.mean().item() if isinstance(field, GridField) else field.step
