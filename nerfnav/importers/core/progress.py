"""Progress of imports: the step that importers of captures, videos and meshes yield before they return."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    from nerfnav.geometry import Box  # imports torch, which the process that poses frames does without


@dataclass(frozen=True, eq=False)
class SparseModel:
    """Cameras and points of photographs, to be shown before there is a field."""

    poses: Float[np.ndarray, "n 4 4"]
    """T_world_camera with OpenGL axes."""
    points: Float[np.ndarray, "m 3"]
    """Points that the photographs show."""
    box: "Box | None" = None
    """Box of the field [m]; None while the cameras are still being posed: frame and unit are then arbitrary."""


@dataclass(frozen=True, eq=False)
class ImportStep:
    """Progress of an import."""

    doing: str
    """Current task, for the user."""
    fraction: float
    """Share that is done, 0 to 1."""
    model: SparseModel | None = None
    """Cameras and points, as soon as they are known; None at most steps."""
