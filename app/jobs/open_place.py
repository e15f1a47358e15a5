"""Open a place and make it visible: the field, its surface, and kernels that are warm before they are needed."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import scenes
from app.jobs.events import JobEvents, JobResult, PlaceOpened, Progress, SurfaceShaped
from app.jobs.surface import surface_of
from app.jobs.warm_up import warm_up
from app.places.opening import open_place
from app.places.place import Place
from nerfnav.field.neural import NeuralField
from nerfnav.importers.kind import source_kind


def run(what: str, opener: Callable[[str], Place] = open_place) -> JobEvents:
    """Yield the place as soon as it is loaded, then its surface; a source is made into a field first.

    Raises NerfnavError as `open_place` does, or where no field can be made. What makes fields is imported only then:
    most places come with one, and the user waits for them.
    """
    if source_kind(what, scenes.names()).command is not None:
        from app.jobs import make_field

        made = make_field.made_before(Path(what))
        if made is None:
            made = make_field.field_path(Path(what))
            yield from make_field.run(Path(what), made)
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
    return JobResult({"name": place.name})
