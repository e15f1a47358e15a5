"""The field of a source: one that is quick enough for a page, made first where there is none.

What makes fields is imported only where it is needed: most places come with a field, and the user waits for them.
"""

from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

import nerfnav_scenes as scenes
from nerfnav.field import NeuralField
from nerfnav.importers import source_kind
from nerfnav_app.jobs.events import JobEvent
from nerfnav_app.places.learning import USUAL, QualityName
from nerfnav_app.places.place import Place


def field_of(what: str, quality: QualityName = USUAL) -> Generator[JobEvent, bool | None, str]:
    """Name or path of the field that is meant by `what`, after making it of a source that is none.

    `quality` is that of what is learned; what was made before is taken as it is.

    Raises NerfnavError where no field can be made.
    """
    if source_kind(what, scenes.names()).command is None:
        return what
    from nerfnav_app.jobs.open import make_field

    made = make_field.made_before(Path(what))
    if made is None:
        made = make_field.field_path(Path(what))
        yield from make_field.run(Path(what), made, quality)
    return str(made)


def quick(place: Place) -> Generator[JobEvent, bool | None, Place]:
    """The place with a field that answers within moments, as a page wants it: networks are baked."""
    if not isinstance(place.field, NeuralField):
        return place
    from nerfnav_app.jobs.field.bake import baking

    return replace(place, field=(yield from baking(place.field, None)))
