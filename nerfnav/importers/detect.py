"""Content type detection: what kind of thing a user means by a name or a path, decided here and nowhere else.

Nothing is read but names in folders and archives and the beginnings of files, so an answer takes milliseconds; whether
a file is whole is told by whoever reads it.
"""

import json
import zipfile
from collections.abc import Collection
from pathlib import Path

import numpy as np

from nerfnav.importers.core.kinds import (
    ARCHIVES,
    CHECKPOINTS,
    FIELD,
    MESHES,
    OWN_SPLATS,
    PICTURES,
    SPLATS,
    VIDEOS,
    SourceKind,
)

_TRUTH = "nerfnav-ground-truth"


def source_kind(what: str | Path, bundled: Collection[str] = ()) -> SourceKind:
    """What kind of thing a name or path means; `bundled` are the names of scenes, which come first."""
    path = Path(what)
    if str(what) in bundled:
        return SourceKind.SCENE
    if path.is_dir():
        from nerfnav.importers.contents import folder_kind  # slow to import, and most places are fields

        return folder_kind(path)
    return _file_kind(path) if path.is_file() else SourceKind.MISSING


def _file_kind(path: Path) -> SourceKind:
    suffix = path.suffix.lower()
    if path.name.lower().endswith(OWN_SPLATS):
        return SourceKind.SPLATS
    if suffix == FIELD:
        return _npz_kind(path)
    if suffix in (".ply", ".json", ".yml", ".yaml", *ARCHIVES):
        from nerfnav.importers import contents  # slow to import, as above

        return contents.archive_kind(path) if suffix in ARCHIVES else contents.described_kind(path, suffix)
    kinds = (
        (SPLATS, SourceKind.SPLATS),
        (MESHES, SourceKind.MESH),
        (CHECKPOINTS, SourceKind.NERF),
        (VIDEOS, SourceKind.VIDEO),
        (PICTURES, SourceKind.PICTURE),
    )
    return next((kind for suffixes, kind in kinds if suffix in suffixes), SourceKind.UNKNOWN)


def _npz_kind(path: Path) -> SourceKind:
    """A field, unless it says otherwise: whoever reads fields tells what is wrong with a broken one."""
    try:
        with np.load(path, allow_pickle=False) as file:
            header = json.loads(str(file["header"]))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return SourceKind.FIELD
    truth = isinstance(header, dict) and header.get("format") == _TRUTH
    return SourceKind.TRUTH if truth else SourceKind.FIELD
