"""Names of fields that are made of sources."""

from pathlib import Path

from nerfnav.importers.suffixes import FIELD

_DESCRIPTIONS = ("meta.json", "transforms.json", "config.yml")


def own_folder(source: Path) -> Path | None:
    """The folder that a source is, or that a file describes which is called as in all such folders; else None."""
    if source.is_dir():
        return source
    return source.parent if source.name.lower() in _DESCRIPTIONS else None


def field_name(what: str | Path) -> str:
    """What a field that is made of a source is called."""
    path = Path(what)
    folder = own_folder(path)
    stem = path.name.split(".")[0] if folder is None else folder.resolve().name
    return f"{stem or 'place'}{FIELD}"
