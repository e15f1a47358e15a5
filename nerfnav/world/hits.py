"""What rays hit."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int32


@dataclass(frozen=True)
class Hits:
    """What n rays hit first."""

    face: Int32[np.ndarray, " n"]
    """Index of the face, -1 where nothing is hit."""
    weights: Float32[np.ndarray, "n 3"]
    """Barycentric weights of the face's corners."""
    distance: Float32[np.ndarray, " n"]
    """From the ray's origin [m], infinite where nothing is hit."""
