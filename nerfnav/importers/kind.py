"""Content type detection: what kind of thing a user means by a name or a path, decided here and nowhere else.

Nothing is read but names in folders and archives and the beginnings of files, so an answer takes milliseconds; whether
a file is whole is told by whoever reads it.
"""

import json
import zipfile
from collections.abc import Collection
from enum import Enum
from pathlib import Path

import numpy as np

from nerfnav.errors import InvalidInputError
from nerfnav.importers.magic import head_of, magic_of
from nerfnav.importers.suffixes import ARCHIVES, CHECKPOINTS, FIELD, MESHES, OWN_SPLATS, PICTURES, SPLATS, VIDEOS

_DESCRIPTIONS = ("meta.json", "transforms.json", "config.yml")
_FLIGHT, _PLAN = "run.json", "plan.json"
_TRUTH = "nerfnav-ground-truth"


class WrongKindError(InvalidInputError):
    """A source of another kind than a command takes; the message says which it is and what takes it."""


class SourceKind(Enum):
    """What a source is, as the words of a sentence."""

    SCENE = "a bundled scene"
    FIELD = "a field"
    SPLATS = "a set of Gaussian splats"
    MESH = "a mesh"
    CAPTURE = "a capture"
    VIDEO = "a video"
    NERF = "a trained NeRF"
    PICTURE = "a picture"
    FLIGHT = "the folder of a flight"
    PLAN = "the folder of a plan"
    TRUTH = "the ground truth of a field"
    MISSING = "not there"
    UNKNOWN = "of no kind that nerfnav knows"

    @property
    def command(self) -> str | None:
        """The subcommand that makes a field of it; None where none does."""
        if self in (SourceKind.MESH, SourceKind.CAPTURE, SourceKind.VIDEO):
            return "train"
        return "import" if self in (SourceKind.SPLATS, SourceKind.NERF) else None


def source_kind(what: str | Path, bundled: Collection[str] = ()) -> SourceKind:
    """What kind of thing a name or path means; `bundled` are the names of scenes, which come first."""
    path = Path(what)
    if str(what) in bundled:
        return SourceKind.SCENE
    if path.is_dir():
        return _folder_kind(path)
    return _file_kind(path) if path.is_file() else SourceKind.MISSING


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


def wrong_kind(what: str | Path, kind: SourceKind, wanted: str) -> WrongKindError:
    """The error for a source of another kind than is `wanted` ("a field"), which names what takes it."""
    path = Path(what)
    if kind is SourceKind.MISSING:
        return WrongKindError(f"there is no file or folder {what}")
    if kind is SourceKind.UNKNOWN:
        named = magic_of(head_of(path)) if path.is_file() else _folder_in_words(path)
        return WrongKindError(
            f"{what} is not {wanted}: it is {named or kind.value}; fields ({FIELD}), meshes ({', '.join(MESHES)}), "
            f"splats ({', '.join(SPLATS)}), captures (a folder, transforms.json or .zip), videos and checkpoints can "
            "be opened"
        )
    return WrongKindError(f"{what} is {kind.value}, and {wanted} is asked for: {_advice(path, kind)}")


def _folder_in_words(folder: Path) -> str:
    if any(entry.suffix.lower() in PICTURES for entry in folder.iterdir()):
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


# Most places are fields, and somebody waits for them: what reads the other kinds is imported when one comes.


def _folder_kind(folder: Path) -> SourceKind:
    from nerfnav.importers.captures.formats import is_capture
    from nerfnav.importers.meshes.folders import mesh_in
    from nerfnav.importers.nerf_pytorch import is_checkpoint
    from nerfnav.importers.splats.layouts import holds_splats

    if (folder / _FLIGHT).is_file():
        return SourceKind.FLIGHT
    if (folder / _PLAN).is_file():
        return SourceKind.PLAN
    if holds_splats(folder):
        return SourceKind.SPLATS
    if is_capture(folder):
        return SourceKind.CAPTURE
    if is_checkpoint(folder):
        return SourceKind.NERF
    return SourceKind.MESH if mesh_in(folder) is not None else SourceKind.UNKNOWN


def _file_kind(path: Path) -> SourceKind:
    suffix = path.suffix.lower()
    if path.name.lower().endswith(OWN_SPLATS):
        return SourceKind.SPLATS
    if suffix == FIELD:
        return _npz_kind(path)
    if suffix in (".ply", ".json", ".yml", ".yaml"):
        return _described_kind(path, suffix)
    if suffix in ARCHIVES:
        from nerfnav.importers.meshes.folders import meshes_in_archive

        return SourceKind.MESH if meshes_in_archive(path) else SourceKind.CAPTURE
    kinds = (
        (SPLATS, SourceKind.SPLATS),
        (MESHES, SourceKind.MESH),
        (CHECKPOINTS, SourceKind.NERF),
        (VIDEOS, SourceKind.VIDEO),
        (PICTURES, SourceKind.PICTURE),
    )
    return next((kind for suffixes, kind in kinds if suffix in suffixes), SourceKind.UNKNOWN)


def _described_kind(path: Path, suffix: str) -> SourceKind:
    """Of files whose endings leave it open."""
    from nerfnav.importers.captures.formats import is_capture
    from nerfnav.importers.splats.layouts import holds_splats

    if holds_splats(path):
        return SourceKind.SPLATS
    if suffix == ".ply":
        head = head_of(path)
        return SourceKind.UNKNOWN if magic_of(head) and not head.startswith(b"ply") else SourceKind.MESH
    return SourceKind.CAPTURE if suffix == ".json" or is_capture(path) else SourceKind.UNKNOWN


def _npz_kind(path: Path) -> SourceKind:
    """A field, unless it says otherwise: whoever reads fields tells what is wrong with a broken one."""
    try:
        with np.load(path, allow_pickle=False) as file:
            header = json.loads(str(file["header"]))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return SourceKind.FIELD
    truth = isinstance(header, dict) and header.get("format") == _TRUTH
    return SourceKind.TRUTH if truth else SourceKind.FIELD
