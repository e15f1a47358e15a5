"""Open a source: source -> field file -> Place, then its surface, and kernels that are warm before they are needed.

A source that is no field becomes one first, and networks are baked, to be quick enough for a page. The modules that
make fields are imported only then: most places come with a field, and the user waits for them. A place of the library
gets its name there; the library notes it as opened, with a picture.
"""

from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import torch

import nerfnav_scenes as scenes
from nerfnav.core.errors import NerfnavError
from nerfnav.core.steps import map_steps
from nerfnav.field import NeuralField, render_image
from nerfnav.geometry import Camera, encode_image, look_at
from nerfnav.importers import Corners, source_kind
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, PlaceOpened, Progress, SurfaceShaped
from nerfnav_app.jobs.export.surface import build_first_surface
from nerfnav_app.jobs.fly.simulated_world import warm_up_filter, warm_up_renderer
from nerfnav_app.jobs.plan import plan
from nerfnav_app.places.ends import default_ends
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.places.place import Place, open_place
from nerfnav_app.places.sources import USUAL, QualityName
from nerfnav_app.places.vantage import view_of_box

_THUMBNAIL, _JPEG_QUALITY = Camera.from_fov(240, 160, 45), 85


def run(
    source: str,
    quality: QualityName = USUAL,
    box: Corners | None = None,
    opener: Callable[[str], Place] = open_place,
) -> JobEvents:
    """Yield the place as soon as it is loaded, then its surface; a source becomes a field of this quality first.

    Raises NerfnavError as `open_place` does, or where no field can be made.
    """
    shown: list[SurfaceShaped] = []

    def note_surface(event: JobEvent) -> JobEvent:
        if isinstance(event, SurfaceShaped):
            shown.append(event)
        return event

    file = yield from map_steps(ensure_field(source, quality, box), note_surface)
    yield Progress("opening the field", 0.05)
    place = yield from _bake_networks(opener(file))
    library = PlaceLibrary()
    kept = library.place_of(source)
    place = place if kept is None else replace(place, name=kept.name)
    yield PlaceOpened(place)
    yield Progress("shaping the surface", 0.3)
    # a mesh that is shown already stays until there is a texture
    of_mesh = shown and place.field.info.learned_from == "mesh"
    yield shown[-1] if of_mesh else SurfaceShaped(*build_first_surface(place))
    if place.file is not None and library.holds(source):
        library.opened(Path(source), place.file, render_thumbnail(place))
    yield from warm_up(place)
    return JobResult({"name": place.name})


def ensure_field(
    source: str, quality: QualityName = USUAL, box: Corners | None = None
) -> Generator[JobEvent, bool | None, str]:
    """Return the name or path of a field: the source itself, or the field that was made of it, now or before.

    `quality` and `box` are those of a field that is made now. Raises NerfnavError where no field can be made.
    """
    if source_kind(source, scenes.names()).command is None:
        return source
    from nerfnav_app.jobs.open import make_field

    made = make_field.find_made_field(Path(source))
    if made is None:
        made = make_field.choose_field_path(Path(source))
        yield from make_field.run(Path(source), made, quality, box)
    return str(made)


def _bake_networks(place: Place) -> Generator[JobEvent, bool | None, Place]:
    """The place with a field that answers within moments, as a page wants it."""
    if not isinstance(place.field, NeuralField):
        return place
    from nerfnav_app.jobs.open.bake import bake_field

    return replace(place, field=(yield from bake_field(place.field, None)))


def render_thumbnail(place: Place) -> bytes:
    """Render the place from a point that shows all of it, as JPEG."""
    lower, upper = (tuple(corner.tolist()) for corner in (place.field.box.lower, place.field.box.upper))
    eye, target = (torch.tensor(point) for point in view_of_box(lower, upper))
    return encode_image(render_image(place.field, _THUMBNAIL, look_at(eye, target)).image.numpy(), _JPEG_QUALITY)


def warm_up(place: Place) -> Iterator[Progress]:
    """Do once, small, what plans and flights will do: then all is imported and compiled, and maps are made.

    The caller may leave it at any step.
    """
    doing = Progress("compiling in the background: plan and fly already work", 0.6)
    yield doing
    if place.truth is not None:
        place.truth.load()
        yield doing
        warm_up_renderer()
        yield doing
    ends = default_ends(place, place.tasks[0].name if place.tasks else None)
    assert ends is not None
    with suppress(NerfnavError):  # such ends may be occupied
        for _ in plan.run(plan.PlanRequest(ends), place):
            yield doing
    for _ in warm_up_filter(place, ends.start.state()):
        yield doing
