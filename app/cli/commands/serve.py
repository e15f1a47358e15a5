"""The place that is served, as far as it can be told before anything slow is imported."""

import importlib.util
from pathlib import Path

from nerfnav_app.places.kept_surface import kept_surface


def shown_before(place: str) -> bytes | None:
    """The surface of a field that this machine has shown before."""
    file = _bundled(place) if comes_along(place) else Path(place)
    return (kept_surface(file) or None) if file.is_file() else None


def comes_along(place: str) -> bool:
    """Whether it is a bundled scene with its field."""
    return place.isidentifier() and _bundled(place).is_file()


def _bundled(scene: str) -> Path:
    """Where the field of a bundled scene would be, found without importing what knows scenes."""
    spec = importlib.util.find_spec("nerfnav_scenes")
    assert spec is not None and spec.origin is not None, "scenes are a part of nerfnav"
    return Path(spec.origin).parent / "trained" / f"{scene}.npz"


def check(place: str) -> None:
    """Raise NerfnavError where there is no such scene or file, or it is nothing that can be opened."""
    import nerfnav_scenes as scenes
    from nerfnav.field import load_field
    from nerfnav.importers import source_kind
    from nerfnav_app.places.place import field_file

    if source_kind(place, scenes.names()).command is None:
        load_field(field_file(place))
