"""Content type detection: decide the kind of a source from its name or path, in one place.

Nothing is read but names in folders and archives and the beginnings of files, so an answer takes milliseconds; readers
check that a file is complete.
"""

from collections.abc import Callable, Collection
from pathlib import Path

from nerfnav.core.files import DamagedNpzError, open_npz, require_fetched
from nerfnav.formats import PICTURES
from nerfnav.importers.core.kinds import (
    ARCHIVES,
    CHECKPOINTS,
    FIELD,
    MESHES,
    OWN_SPLATS,
    SPLATS,
    VIDEOS,
    SourceKind,
    identify_data,
    read_head,
)

_TRUTH = "nerfnav-ground-truth"


def source_kind(what: str | Path, bundled: Collection[str] = ()) -> SourceKind:
    """Decide the kind of a name or path; `bundled` are the names of scenes, which come first.

    Raises InvalidInputError for a pointer of Git LFS, which has the name of a kind, and nothing of it.
    """
    path = Path(what)
    if str(what) in bundled:
        return SourceKind.SCENE
    if path.is_dir():
        return _folder_kind(path)
    if not path.is_file():
        return SourceKind.MISSING
    require_fetched(path)
    return _file_kind(path)


def _folder_kind(folder: Path) -> SourceKind:
    """Kind of a folder, by the files in it."""
    from nerfnav.importers.captures.formats import is_capture
    from nerfnav.importers.meshes.files import find_mesh
    from nerfnav.importers.nerf.checkpoint import is_checkpoint
    from nerfnav.importers.splats.formats import holds_splats
    from nerfnav.importers.splats.sog import META, is_sog

    kinds: tuple[tuple[SourceKind, Callable[[Path], object]], ...] = (
        (SourceKind.FLIGHT, lambda path: (path / "run.json").is_file()),
        (SourceKind.PLAN, lambda path: (path / "plan.json").is_file()),
        (SourceKind.SPLATS, lambda path: is_sog(path / META)),
        (SourceKind.CAPTURE, is_capture),
        (SourceKind.SPLATS, holds_splats),
        (SourceKind.NERF, is_checkpoint),
        (SourceKind.MESH, find_mesh),
    )
    return next((kind for kind, holds in kinds if holds(folder)), SourceKind.UNKNOWN)


def _described_kind(path: Path, suffix: str) -> SourceKind:
    """Kind of a file with an ending of several kinds, by its header or by the folder that it describes."""
    from nerfnav.importers.captures.formats import is_capture
    from nerfnav.importers.splats.formats import holds_splats

    if holds_splats(path):
        return SourceKind.SPLATS
    if suffix == ".ply":
        head = read_head(path)
        return SourceKind.UNKNOWN if identify_data(head) and not head.startswith(b"ply") else SourceKind.MESH
    return SourceKind.CAPTURE if suffix == ".json" or is_capture(path) else SourceKind.UNKNOWN


def _file_kind(path: Path) -> SourceKind:
    suffix = path.suffix.lower()
    if path.name.lower().endswith(OWN_SPLATS):
        return SourceKind.SPLATS
    if suffix == FIELD:
        return _npz_kind(path)
    if suffix in ARCHIVES:
        from nerfnav.importers.meshes.files import list_archived_meshes
        from nerfnav.importers.splats.containers import list_splats

        if list_splats(path):
            return SourceKind.SPLATS
        return SourceKind.MESH if list_archived_meshes(path) else SourceKind.CAPTURE
    if suffix in (".ply", ".json", ".yml", ".yaml"):
        return _described_kind(path, suffix)
    kinds = (
        (SPLATS, SourceKind.SPLATS),
        (MESHES, SourceKind.MESH),
        (CHECKPOINTS, SourceKind.NERF),
        (VIDEOS, SourceKind.VIDEO),
        (PICTURES, SourceKind.PICTURE),
    )
    return next((kind for suffixes, kind in kinds if suffix in suffixes), SourceKind.UNKNOWN)


def _npz_kind(path: Path) -> SourceKind:
    """Field, unless the header has the format of a ground truth; readers of fields report broken files."""
    try:
        with open_npz(path) as file:
            return SourceKind.TRUTH if file.header.get("format") == _TRUTH else SourceKind.FIELD
    except (OSError, DamagedNpzError):
        return SourceKind.FIELD
