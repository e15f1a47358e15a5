"""Kinds of sources."""

from enum import Enum


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
