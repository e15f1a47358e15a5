"""Open a place and make it visible: the field, its surface, and kernels that are warm before they are needed."""

from collections.abc import Callable

from nerfnav_app.jobs.events import JobEvents, JobResult, PlaceOpened, Progress, SurfaceShaped
from nerfnav_app.jobs.keep_place import named_as_kept, note_kept
from nerfnav_app.jobs.source_field import field_of, quick
from nerfnav_app.jobs.surface import first_surface_of
from nerfnav_app.jobs.warm_up import warm_up
from nerfnav_app.places.learning import USUAL, QualityName
from nerfnav_app.places.place import Place, open_place


def run(what: str, quality: QualityName = USUAL, opener: Callable[[str], Place] = open_place) -> JobEvents:
    """Yield the place as soon as it is loaded, then its surface; a source is made into a field of this quality first.

    Raises NerfnavError as `open_place` does, or where no field can be made. What makes fields is imported only then:
    most places come with one, and the user waits for them.
    """
    source = what
    what = yield from field_of(source, quality)
    yield Progress("opening the field", 0.05)
    place = opener(what)
    place = named_as_kept(source, (yield from quick(place)))
    yield PlaceOpened(place)
    yield Progress("shaping the surface", 0.3)
    yield SurfaceShaped(*first_surface_of(place))
    note_kept(source, place)
    yield from warm_up(place)
    return JobResult({"name": place.name})
