"""Open a place and make it visible: the field, its surface, and kernels that are warm before they are needed."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import torch

import scenes
from app.jobs import plan
from app.jobs.events import JobEvent, JobFinished, PlaceOpened, Progress, SurfaceShaped
from app.jobs.plan import PlanRequest
from app.places.ends import opening_ends
from app.places.place import Place, open_place
from app.places.surface_glb import kept_surface, unlit_glb, without_specks
from nerfnav.errors import NerfnavError
from nerfnav.estimator.belief import Belief
from nerfnav.estimator.fast import FastFilter
from nerfnav.field.meshing import field_mesh
from nerfnav.field.neural import NeuralField
from nerfnav.field.render import render_image
from nerfnav.field.voxel import VoxelField
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera
from nerfnav.importers.kind import source_kind
from nerfnav.navigation.replan import NavigateConfig

_CELLS = 140
"""Cells of the surface along the longest edge of the box: finer ones cost the browser more than they show."""
_LEVEL, _DEPTH = 15.0, 0.3
"""Density at the surface [1/m], or this optical depth of a voxel where that is less: low enough that thin parts have
no holes, high enough that fog is not seen."""

_SPECK = 400
"""Parts of the surface with fewer faces than this are not shown."""


def run(what: str, opener: Callable[[str], Place] = open_place) -> Iterator[JobEvent]:
    """Yield the place as soon as it is loaded, then its surface; a source is made into a field first.

    Raises NerfnavError as `open_place` does, or where no field can be made. What makes fields is imported only then:
    most places come with one, and somebody waits for them.
    """
    if source_kind(what, scenes.names()).command is not None:
        from app.jobs import make_field

        made = make_field.made_before(Path(what))
        if made is None:
            made = make_field.field_path(Path(what))
            for event in make_field.run(Path(what), made):
                if not isinstance(event, JobFinished):  # the job goes on
                    yield event
        what = str(made)
    yield Progress("opening the field", 0.05)
    place = opener(what)
    if isinstance(place.field, NeuralField):  # a page wants answers within moments
        from app.jobs.import_field import baking

        place = replace(place, field=(yield from baking(place.field, None)))
    yield PlaceOpened(place)
    yield Progress("shaping the surface", 0.3)
    if surface := surface_of(place):
        yield SurfaceShaped(surface)
    yield from warm_up(place)
    yield JobFinished("open", {"name": place.name})


def surface_of(place: Place) -> bytes:
    """What stands for the field in viewers, as unlit binary glTF; shaped once on this machine for each field.

    Empty where the field has nothing dense, such as one that was hardly trained.
    """

    def shape() -> bytes:
        box = place.field.box
        spacing = float(box.size.max()) / _CELLS
        mesh = without_specks(field_mesh(place.field, spacing, min(_LEVEL, _DEPTH / _voxel(place))), _SPECK)
        return unlit_glb(mesh, (box.lower.tolist(), box.upper.tolist())) if len(mesh.faces) else b""

    if place.file is None or not isinstance(place.field, VoxelField):
        return shape()
    return kept_surface(place.file, shape) or b""


def _voxel(place: Place) -> float:
    """How fine the field is [m]."""
    field = place.field
    return field.spacing.mean().item() if isinstance(field, VoxelField) else field.step


def warm_up(place: Place) -> Iterator[Progress]:
    """Do once, small, what plans and flights will do: by then all is imported and compiled, and maps are made.

    Whoever does not want to wait for it may leave it at any step.
    """
    doing = Progress("compiling kernels, which takes longer the first time", 0.6)
    yield doing
    if place.truth is not None:
        place.truth.load()
        yield doing
    ends = opening_ends(place, place.tasks[0].name if place.tasks else None)
    assert ends is not None
    request = PlanRequest(ends)
    with suppress(NerfnavError):  # ends that nobody chose may be occupied
        for _ in plan.run(request, place):
            yield doing
    start, camera = ends.start.state(), Camera.from_fov(64, 64, 90)
    picture = render_image(place.field, camera, start.pose.compose(FORWARD_MOUNT)).image
    belief, draws = Belief(start, NavigateConfig().initial.covariance()), torch.Generator().manual_seed(0)
    for _ in FastFilter(place.field, place.robot, camera).correct(belief, picture, draws):
        yield doing
