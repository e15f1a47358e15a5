"""What is asked of an import."""

from dataclasses import dataclass, field
from pathlib import Path

from nerfnav.core.errors import require_positive
from nerfnav.importers import (
    Placement,
)


@dataclass(frozen=True)
class ImportRequest:
    """What to import."""

    source: Path
    """A checkpoint, a folder with one, or a file of splats."""
    out: Path
    """The file for the field."""
    voxel: float | None = None
    """Distance of the nodes of a voxel field [m]; None: by the size of the place."""
    keep_network: bool = False
    """Whether a NeRF stays networks, which take seconds for a picture; else it is baked into a voxel field."""
    placement: Placement = field(default_factory=Placement)
    """How the source lies in the world."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no field can have."""
        require_positive(voxel=self.voxel)
