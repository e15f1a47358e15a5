"""Open a source: source -> field file -> Place, then its surface, and kernels that are warm before they are needed.

A source that is no field is made into one first, and networks are baked, to be quick enough for a page. The modules
that make fields are imported only then: most places come with a field, and the user waits for them. A place of the
library gets its name there; it is noted there as opened, with a picture.
"""


from collections.abc import Callable, Generator
from dataclasses import replace
from pathlib import Path

import torch

import nerfnav_scenes as scenes
from nerfnav.field import NeuralField, render_image
from nerfnav.geometry import Camera, encode_image, look_at
from nerfnav.importers import source_kind
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, PlaceOpened, Progress, SurfaceShaped
from nerfnav_app.jobs.export.surface import build_first_surface
from nerfnav_app.jobs.open.warm_up import warm_up
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.places.place import Place, open_place
from nerfnav_app.places.sources import USUAL, QualityName
from nerfnav_app.places.vantage import view_of_box


def ensure_field(what: str, quality: QualityName = USUAL) -> Generator[JobEvent, bool | None, str]:
    """Name or path of the field that is meant by `what`, after making it of a source that is none.

    `quality` is that of what is learned; what was made before is taken as it is.

    Raises NerfnavError where no field can be made.
    """
    if source_kind(what, scenes.names()).command is None:
        return what
    from nerfnav_app.jobs.open import make_field

    made = make_field.find_made_field(Path(what))
    if made is None:
        made = make_field.choose_field_path(Path(what))
        yield from make_field.run(Path(what), made, quality)
    return str(made)


def quick(place: Place) -> Generator[JobEvent, bool | None, Place]:
    """The place with a field that answers within moments, as a page wants it: networks are baked."""
    if not isinstance(place.field, NeuralField):
        return place
    from nerfnav_app.jobs.field.bake import bake_field

    return replace(place, field=(yield from bake_field(place.field, None)))


_PICTURE = Camera.from_fov(240, 160, 45)
_QUALITY = 85


def named_as_kept(source: str, place: Place) -> Place:
    """The place under the name that it has in the library; as it is where it is not in there."""
    kept = PlaceLibrary().place_of(source)
    return place if kept is None else replace(place, name=kept.name)


def note_kept(source: str, place: Place) -> None:
    """Note in the library that the place of a `source` was opened; nothing, where the source lies elsewhere."""
    library = PlaceLibrary()
    if place.file is not None and library.holds(source):
        library.opened(Path(source), place.file, render_thumbnail(place))


def render_thumbnail(place: Place) -> bytes:
    """The place from where all of it is seen, as JPEG."""
    lower, upper = (tuple(corner.tolist()) for corner in (place.field.box.lower, place.field.box.upper))
    eye, target = (torch.tensor(point) for point in view_of_box(lower, upper))
    return encode_image(render_image(place.field, _PICTURE, look_at(eye, target)).image.numpy(), _QUALITY)


def run(what: str, quality: QualityName = USUAL, opener: Callable[[str], Place] = open_place) -> JobEvents:
    """Yield the place as soon as it is loaded, then its surface; a source is made into a field of this quality first.

    Raises NerfnavError as `open_place` does, or where no field can be made. What makes fields is imported only then:
    most places come with one, and the user waits for them.
    """
    source = what
    what = yield from ensure_field(source, quality)
    yield Progress("opening the field", 0.05)
    place = opener(what)
    place = named_as_kept(source, (yield from quick(place)))
    yield PlaceOpened(place)
    yield Progress("shaping the surface", 0.3)
    yield SurfaceShaped(*build_first_surface(place))
    note_kept(source, place)
    yield from warm_up(place)
    return JobResult({"name": place.name})
