"""Open a place and make it visible: the field, its surface, and kernels that are warm before they are needed."""

from collections.abc import Callable

from app.jobs.events import JobEvents, JobResult, PlaceOpened, Progress, SurfaceShaped
from app.jobs.keep_place import named_as_kept, note_kept
from app.jobs.source_field import field_of, quick
from app.jobs.surface import surface_of
from app.jobs.warm_up import warm_up
from app.places.opening import open_place
from app.places.place import Place


def run(what: str, opener: Callable[[str], Place] = open_place) -> JobEvents:
    """Yield the place as soon as it is loaded, then its surface; a source is made into a field first.

    Raises NerfnavError as `open_place` does, or where no field can be made. What makes fields is imported only then:
    most places come with one, and the user waits for them.
    """
    source = what
    what = yield from field_of(source)
    yield Progress("opening the field", 0.05)
    place = opener(what)
    place = named_as_kept(source, (yield from quick(place)))
    yield PlaceOpened(place)
    yield Progress("shaping the surface", 0.3)
    if surface := surface_of(place):
        yield SurfaceShaped(surface)
    note_kept(source, place)
    yield from warm_up(place)
    return JobResult({"name": place.name})
