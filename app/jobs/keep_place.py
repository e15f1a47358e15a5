"""What a job does for the library: a place that opened is noted there with its picture, and goes by its name there."""

from dataclasses import replace
from pathlib import Path

import torch

from nerfnav.field import render_image
from nerfnav.geometry import Camera, look_at, picture_file
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.places.place import Place
from nerfnav_app.places.vantage import view_of_box

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
        library.opened(Path(source), place.file, picture_of(place))


def picture_of(place: Place) -> bytes:
    """The place from where all of it is seen, as JPEG."""
    lower, upper = (tuple(corner.tolist()) for corner in (place.field.box.lower, place.field.box.upper))
    eye, target = (torch.tensor(point) for point in view_of_box(lower, upper))
    return picture_file(render_image(place.field, _PICTURE, look_at(eye, target)).image.numpy(), _QUALITY)
