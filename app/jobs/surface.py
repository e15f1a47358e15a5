"""Isosurface of a place's field, as viewers show it."""

from app.places.place import Place
from app.places.surface_glb import kept_surface, unlit_glb, without_specks
from nerfnav.field import field_mesh
from nerfnav.field.grid_field import GridField

_CELLS = 140
"""Cells of the surface along the longest edge of the box: finer ones cost the browser more than they show."""
_LEVEL, _DEPTH = 15.0, 0.3
"""Density at the surface [1/m], or this optical depth of a voxel where that is less: low enough that thin parts have
no holes, high enough that fog is not seen."""

_SPECK = 400
"""Parts of the surface with fewer faces than this are not shown."""


def surface_of(place: Place) -> bytes:
    """What stands for the field in viewers, as unlit binary glTF; shaped once on this machine for each field.

    Empty where the field has nothing dense, such as one that was hardly trained.
    """

    def shape() -> bytes:
        box = place.field.box
        spacing = float(box.size.max()) / _CELLS
        mesh = without_specks(field_mesh(place.field, spacing, min(_LEVEL, _DEPTH / _voxel(place))), _SPECK)
        return unlit_glb(mesh, (box.lower.tolist(), box.upper.tolist())) if len(mesh.faces) else b""

    if place.file is None or not isinstance(place.field, GridField):
        return shape()
    return kept_surface(place.file, shape) or b""


def _voxel(place: Place) -> float:
    """How fine the field is [m]."""
    field = place.field
    return field.spacing.mean().item() if isinstance(field, GridField) else field.step
