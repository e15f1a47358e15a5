"""Content inspection: the kind of folders, archives and files whose endings leave it open.

Imported only when needed, with the readers of all kinds: most places are fields, and somebody waits for them.
"""

from pathlib import Path

from nerfnav.importers.captures.formats import is_capture
from nerfnav.importers.core.kinds import SourceKind
from nerfnav.importers.core.magic import head_of, magic_of
from nerfnav.importers.meshes.folders import mesh_in, meshes_in_archive
from nerfnav.importers.nerf.checkpoint import is_checkpoint
from nerfnav.importers.splats.formats import holds_splats

_FLIGHT, _PLAN = "run.json", "plan.json"


def folder_kind(folder: Path) -> SourceKind:
    """By the files in it."""
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


def archive_kind(path: Path) -> SourceKind:
    """By the names of the files in it."""
    return SourceKind.MESH if meshes_in_archive(path) else SourceKind.CAPTURE


def described_kind(path: Path, suffix: str) -> SourceKind:
    """By its header, or by what it describes."""
    if holds_splats(path):
        return SourceKind.SPLATS
    if suffix == ".ply":
        head = head_of(path)
        return SourceKind.UNKNOWN if magic_of(head) and not head.startswith(b"ply") else SourceKind.MESH
    return SourceKind.CAPTURE if suffix == ".json" or is_capture(path) else SourceKind.UNKNOWN
