"""Isosurface of a place's field, as viewers show it."""

from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nerfnav.core.steps import run_steps
from nerfnav.field import GridField, field_mesh, open_rooms
from nerfnav.field.surface.texture import texture_mesh
from nerfnav_app.places.kept_surface import keep_surface, kept_surface
from nerfnav_app.places.place import Place
from nerfnav_app.places.surface_glb import encode_colored_glb, encode_textured_glb, remove_specks, simplified

if TYPE_CHECKING:
    import trimesh

    from nerfnav.world import Scene

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

    from nerfnav.world import scene_color

    vertices, faces = np.asarray(scene.mesh.vertices), np.asarray(scene.mesh.faces)
    origin = np.arange(len(faces))
    if len(faces) < _MOST_FACES:
        edge = float(scene.box.size.max()) / _EDGE
        finer = trimesh.remesh.subdivide_to_size(vertices, faces, edge, return_index=True)
        vertices, faces, origin = finer[0], finer[1], finer[-1]
    corners = vertices[faces].reshape(-1, 3)
    face = np.repeat(origin, 3).astype(np.int32)
    weights = trimesh.triangles.points_to_barycentric(scene.mesh.triangles[face], corners)
    colors = scene_color(scene)(face, weights.astype(np.float32)).round().clip(0, 255).astype(np.uint8)
    lower, upper = scene.box.lower.tolist(), scene.box.upper.tolist()
    apart = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), vertex_colors=colors, process=False)
    return encode_colored_glb(apart, (lower, upper))


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
    """The file that the surface is kept for; None for other fields than grids, whose surface is shaped each time."""
    return place.file if isinstance(place.field, GridField) else None


def _voxel(place: Place) -> float:
    """Resolution of the field [m]."""
    field = place.field
    return field.spacing.mean().item() if isinstance(field, GridField) else field.step
