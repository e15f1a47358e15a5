"""Errors of importers: a source of the wrong kind, and a mesh file that cannot be read.

The message for a wrong kind names the kind and the command that takes it.
"""

from pathlib import Path

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.core.errors import first_line as first_line
from nerfnav.formats import PICTURES, list_folder
from nerfnav.importers.core.kinds import (
    FIELD,
    MESHES,
    SPLATS,
    SourceKind,
    field_name,
    identify_data,
    read_head,
)
from nerfnav.importers.core.placement import Corners


class WrongKindError(InvalidInputError):
    """Wrong kind of source: the message names its kind and the command that takes it."""


def wrong_kind_error(what: str | Path, kind: SourceKind, wanted: str) -> WrongKindError:
    """The error for a source of another kind than is `wanted` ("a field"), which names what takes it."""
    path = Path(what)
    if kind is SourceKind.MISSING:
        return WrongKindError(f"there is no file or folder {what}")
    if kind is SourceKind.UNKNOWN:
        named = identify_data(read_head(path)) if path.is_file() else _folder_in_words(path)
        return WrongKindError(
            f"{what} is not {wanted}: it is {named or kind.value}; fields ({FIELD}), meshes ({', '.join(MESHES)}), "
            f"splats ({', '.join(SPLATS)}), captures (a folder, transforms.json or .zip), videos and checkpoints can "
            "be opened"
        )
    return WrongKindError(f"{what} is {kind.value}, and {wanted} is asked for: {_advice(path, kind)}")


def _folder_in_words(folder: Path) -> str:
    if any(entry.suffix.lower() in PICTURES for entry in list_folder(folder)):
        return "a folder of pictures without poses (COLMAP, or nerfstudio's ns-process-data, finds them)"
    return "a folder of nothing that can be opened"


def _advice(path: Path, kind: SourceKind) -> str:
    if kind.command is not None:
        return f"`nerfnav {kind.command} {path} --out {field_name(path)}` makes a field of it"
    return {
        SourceKind.PICTURE: f"`nerfnav localize FIELD {path}` finds where it was taken",
        SourceKind.FLIGHT: f"`nerfnav export {path} --format csv --out FILE` writes its trajectory",
        SourceKind.PLAN: f"`nerfnav export {path} --format csv --out FILE` writes its trajectory",
        SourceKind.TRUTH: f"open the field beside it, {path.name.replace('.truth', '')}",
    }.get(kind, f"`nerfnav open {path}` shows it")


class MeshFileError(NerfnavError):
    """A file that is no mesh that can be worked with."""


class StrayPartsError(MeshFileError):
    """A mesh with parts far away from the rest, where no box says whether they belong to the place."""

    def __init__(self, finding: str, advice: str, without: Corners) -> None:
        """Keep the box `without` these parts beside what was found, and the options that the `advice` names."""
        super().__init__(finding, advice)
        self.without = without

    @property
    def finding(self) -> str:
        """The sentence without advice, for users who choose by a button."""
        return self.args[0]

    def __str__(self) -> str:
        return "; ".join(self.args)
