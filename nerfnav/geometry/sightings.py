"""Points of a place and from which images each was seen: the tracks of structure from motion."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor


@dataclass(frozen=True)
class Sightings:
    """Points, and which images show which of them."""

    points: Float[Tensor, "m 3"]
    """Where they are, in the world [m]."""
    image: Int[Tensor, " k"]
    """Of each sighting, which image."""
    point: Int[Tensor, " k"]
    """Of each sighting, which point that image shows."""

    def __len__(self) -> int:
        """How many sightings there are."""
        return len(self.image)

    def of_images(self, chosen: Int[Tensor, " n"]) -> "Sightings":
        """Those of the `chosen` images, which are numbered in this order from then on; all points stay."""
        known = torch.cat([self.image, chosen])
        number = torch.full((int(known.max()) + 1 if len(known) else 0,), -1)
        number[chosen] = torch.arange(len(chosen))
        image = number[self.image]
        return Sightings(self.points, image[image >= 0], self.point[image >= 0])

    def where(self, kept: Tensor) -> "Sightings":
        """The sightings of those points alone for which `kept` (m) is true."""
        number = kept.long().cumsum(0) - 1
        told = kept[self.point]
        return Sightings(self.points[kept], self.image[told], number[self.point[told]])
