"""Axis-aligned box in the world: the domain of a field, and the space in which a robot may be."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core.structs import TensorStruct


@dataclass(frozen=True)
class Box(TensorStruct):
    """The points between `lower` and `upper`, coordinate by coordinate."""

    lower: Float[Tensor, "3"]
    """Smallest x, y, z [m]."""
    upper: Float[Tensor, "3"]
    """Largest x, y, z [m]."""

    @classmethod
    def of(
        cls, lower: tuple[float, float, float] | np.ndarray, upper: tuple[float, float, float] | np.ndarray
    ) -> "Box":
        """A box from plain numbers [m]."""
        return cls(torch.tensor(lower, dtype=torch.float32), torch.tensor(upper, dtype=torch.float32))

    @property
    def size(self) -> Float[Tensor, "3"]:
        """Edge lengths along x, y, z [m]."""
        return self.upper - self.lower

    @property
    def center(self) -> Float[Tensor, "3"]:
        """The middle of the box [m]."""
        return 0.5 * (self.lower + self.upper)

    def contains(self, points: Float[Tensor, "*batch 3"]) -> Bool[Tensor, "*batch"]:
        """Mark points [m] that lie inside the box or on its border."""
        return ((points >= self.lower) & (points <= self.upper)).all(-1)

    def grown(self, reach: float) -> "Box":
        """The box with `reach` [m] more on each side."""
        return Box(self.lower - reach, self.upper + reach)

    def window(
        self, first: Float[np.ndarray, "3"], spacing: Float[np.ndarray, "3"], shape: tuple[int, ...]
    ) -> tuple[slice, slice, slice]:
        """Find the nodes in the box of a grid of a `shape`, from `first` [m] on and `spacing` [m] apart."""
        low = np.ceil((self.lower.double().numpy() - first) / spacing - 1e-6).astype(int).clip(0, shape)
        high = np.floor((self.upper.double().numpy() - first) / spacing + 1e-6).astype(int)
        high = high.clip(-1, np.array(shape) - 1)
        x, y, z = (slice(int(a), max(int(a), int(b) + 1)) for a, b in zip(low, high, strict=True))
        return x, y, z

    def describe(self) -> str:
        """The box as a user would read it, in metres."""
        pairs = zip("xyz", self.lower.tolist(), self.upper.tolist(), strict=True)
        return ", ".join(f"{axis} {low:.2f} to {high:.2f}" for axis, low, high in pairs) + " m"
