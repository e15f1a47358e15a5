"""Similarity transforms: how a place lies in the world before and after it was measured and levelled.

Notation: p' = s R p + t, with a scale s > 0, a rotation R and a translation t.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.structs import TensorStruct
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Pose

_RIGID = 1e-4
"""Tolerance of R R' against the identity."""
_QUARTER = 1e-4
"""Tolerance of entries of R against -1, 0 and 1 where it permutes the axes [rad]."""


@dataclass(frozen=True)
class Similarity(TensorStruct):
    """A change of coordinates that keeps angles, in double precision."""

    rotation: Float[Tensor, "3 3"]
    """R."""
    translation: Float[Tensor, "3"]
    """t [m]."""
    scale: float = 1.0
    """s: how many metres a metre of before is now."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for what is no similarity."""
        off = (self.rotation @ self.rotation.T - torch.eye(3, dtype=self.rotation.dtype)).abs().max()
        if not (off < _RIGID and torch.linalg.det(self.rotation) > 0 and bool(self.translation.isfinite().all())):
            raise InvalidInputError("a similarity has a rotation and a finite translation")
        if not 0 < self.scale < math.inf:
            raise InvalidInputError(f"the scale of a similarity is a number above 0, not {self.scale:g}")

    @classmethod
    def identity(cls) -> "Similarity":
        """The transform that changes nothing."""
        return cls(torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64))

    @property
    def numbers(self) -> tuple[float, ...]:
        """s, then R row by row, then t, as files keep it."""
        return float(self.scale), *self.rotation.flatten().tolist(), *self.translation.tolist()

    @classmethod
    def of_numbers(cls, numbers: tuple[float, ...]) -> "Similarity":
        """The similarity of `numbers`."""
        scale, *rest = numbers
        matrix = torch.tensor(rest, dtype=torch.float64)
        return cls(matrix[:9].reshape(3, 3), matrix[9:], scale)

    def after(self, first: "Similarity") -> "Similarity":
        """`first`, and then this one."""
        moved = self.scale * (self.rotation @ first.translation) + self.translation
        return Similarity(self.rotation @ first.rotation, moved, self.scale * first.scale)

    @property
    def axes(self) -> Float[Tensor, "3 3"] | None:
        """R with entries of -1, 0 and 1 alone, where it takes axes to axes (quarter turns); None for all else."""
        whole = self.rotation.round()
        return whole if (self.rotation - whole).abs().max() < _QUARTER else None

    def __call__(self, points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
        """Transform points [m]."""
        return (self.scale * points.double() @ self.rotation.T + self.translation).to(points.dtype)

    def inverted(self) -> "Similarity":
        """Inverse of the transform."""
        back = self.rotation.T
        return Similarity(back, -(back @ self.translation) / self.scale, 1 / self.scale)

    def box(self, box: Box) -> Box:
        """The smallest box around where a box is afterwards."""
        corners = torch.cartesian_prod(*torch.stack([box.lower, box.upper]).double().unbind(1))
        moved = self(corners)
        return Box(moved.amin(0).to(box.lower.dtype), moved.amax(0).to(box.lower.dtype))

    def pose(self, pose: Pose) -> Pose:
        """Transform the pose of a camera that sees the same picture: it is moved and turned, its optics stay."""
        return Pose((self.rotation @ pose.rotation.double()).to(pose.rotation.dtype), self(pose.position))
