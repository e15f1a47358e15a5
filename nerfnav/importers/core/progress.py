"""Progress of imports: the step that importers of captures, videos and meshes yield before they return."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ImportStep:
    """Progress of an import."""

    doing: str
    """Current task, for the user."""
    fraction: float
    """Share that is done, 0 to 1."""
