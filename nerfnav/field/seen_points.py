"""Rays to points that structure from motion found: each ends there, for a photograph shows the point."""

from dataclasses import dataclass

import numpy as np
import torch

from nerfnav.geometry import Box, PosedImages

_SPARED = 32
"""Training steps in which a sighting is drawn once, at most."""


@dataclass(frozen=True)
class PointBatch:
    """Rays whose ends are known, as many as one training step looks at."""

    origins: np.ndarray
    """Camera centres (n, 3) [m]."""
    directions: np.ndarray
    """Unit viewing directions (n, 3)."""
    distances: np.ndarray
    """How far away the points are (n) [m]."""
    jitter: np.ndarray
    """Offset of the samples of each ray, in steps (n), -0.5 to 0.5."""


class PointSampler:
    """Draws random sightings of the points in a box, each with the same chance."""

    def __init__(self, photographs: PosedImages, box: Box, generator: torch.Generator) -> None:
        """Look at the sightings of `photographs`; `generator` decides which come when."""
        assert photographs.sightings is not None, "these photographs come without points"
        sightings = photographs.sightings.where(box.contains(photographs.sightings.points))
        self._sightings, self._generator = sightings, generator
        self._centers = photographs.poses.position

    def __len__(self) -> int:
        """How many sightings there are."""
        return len(self._sightings)

    def draw(self, count: int) -> PointBatch:
        """`count` random ones, or fewer where there are few: none is to count as much as all that pixels tell."""
        count = min(count, -(-len(self) // _SPARED))
        chosen = torch.randint(len(self), (count,), generator=self._generator)
        origins = self._centers[self._sightings.image[chosen]]
        toward = self._sightings.points[self._sightings.point[chosen]] - origins
        distances = toward.norm(dim=-1).clamp_min(1e-9)
        jitter = torch.rand(count, generator=self._generator) - 0.5
        arrays = origins, toward / distances[:, None], distances, jitter
        return PointBatch(*(np.ascontiguousarray(array.numpy(), np.float32) for array in arrays))


def points_of(photographs: PosedImages, box: Box, generator: torch.Generator) -> PointSampler | None:
    """What draws the points of photographs; None where there is none to learn from: depth maps say more."""
    if photographs.sightings is None or photographs.depth is not None:
        return None
    sampler = PointSampler(photographs, box, generator)
    return sampler if len(sampler) else None
