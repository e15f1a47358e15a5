"""What does not average out where pictures are held against a field, in the tangent of a state (see apparent.py)."""

from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator import Belief
from nerfnav.estimator.covariance import POSE
from nerfnav.geometry import Pose


@dataclass(frozen=True)
class LastingError:
    """Of one field and one camera."""

    numbers: tuple[float, ...]
    """6 x 6, row by row, in the camera's axes (see estimator/pose_error.py); none: there is none."""
    mount: Pose
    """T_body_camera."""

    def at(self, belief: Belief) -> Float[Tensor, "12 12"]:
        """F, where the camera is believed to be."""
        turn = torch.block_diag(belief.mean.pose.compose(self.mount).rotation, torch.eye(3))
        floor, pose = torch.zeros_like(belief.covariance), torch.tensor(POSE)
        floor[pose[:, None], pose] = turn @ self._on_body @ turn.T
        return floor

    @cached_property
    def _on_body(self) -> Float[Tensor, "6 6"]:
        """Of position in the camera's axes and attitude in the body's tangent."""
        if not self.numbers:
            return torch.zeros(6, 6)
        turn = torch.block_diag(torch.eye(3), self.mount.rotation)
        return turn @ torch.tensor(self.numbers).reshape(6, 6) @ turn.T
