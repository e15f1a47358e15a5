"""Source kinds: the endings of readable files, the kinds of sources, and the names of fields made of them.

Light on purpose: naming an ending or a kind imports none of the readers.
"""


from enum import Enum
from pathlib import Path

FIELD = ".npz"
"""A field that nerfnav wrote."""
MESHES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".dae")
SPLATS = (".ply", ".splat", ".spz", ".sog", ".ksplat")
"""Gaussian splats; a .ply may be a mesh instead."""
OWN_SPLATS = ".splats.npz"
"""nerfnav's own files of splats, which lie beside the field that was made of them."""
CHECKPOINTS = (".ckpt", ".tar", ".pth", ".pt")
"""Trained NeRFs."""
ARCHIVES = (".zip", ".r3d")
"""Archives that hold a capture or a mesh."""
VIDEOS = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm")
PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff", ".heic")
UPLOADS = tuple(dict.fromkeys((FIELD, *MESHES, *SPLATS, *ARCHIVES, *VIDEOS, *CHECKPOINTS)))
"""All that can be opened as one file."""


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


_DESCRIPTIONS = ("meta.json", "transforms.json", "config.yml")


def folder_of_source(source: Path) -> Path | None:
    """The folder that a source is, or that a file describes which is called as in all such folders; else None."""
    if source.is_dir():
        return source
    return source.parent if source.name.lower() in _DESCRIPTIONS else None


def field_name(what: str | Path) -> str:
    """What a field that is made of a source is called."""
    path = Path(what)
    folder = folder_of_source(path)
    stem = path.name.split(".")[0] if folder is None else folder.resolve().name
    return f"{stem or 'place'}{FIELD}"
