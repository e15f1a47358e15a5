"""What does not average out where pictures are held against a field, in the tangent of a state (see apparent.py)."""

from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.apparent import apparent
from nerfnav.estimator.belief import Belief
from nerfnav.estimator.covariance import POSE
from nerfnav.geometry import FORWARD_MOUNT, Pose


@dataclass(frozen=True)
class LastingError:
    """Of one field and one camera."""

    numbers: tuple[float, ...] = ()
    """6 x 6, row by row, in the camera's axes (see estimator/pose_error.py); none: there is none."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""

    def at(self, belief: Belief) -> Float[Tensor, "12 12"]:
        """F, where the camera is believed to be."""
        turn = torch.block_diag(belief.mean.pose.compose(self.mount).rotation, torch.eye(3))
        floor, pose = torch.zeros_like(belief.covariance), torch.tensor(POSE)
        floor[pose[:, None], pose] = turn @ self._on_body @ turn.T
        return floor

    def beside(self, belief: Belief) -> Belief:
        """One of x and y = x (+) e, as apparent.py has them, from a belief of the other, where pictures have told it.

        While e stays the same, y moves as x does and the field shows y without an error: a filter that knows nothing of
        e follows y, y ~ N(m, P), as quickly as it should. Of e no picture tells anything, so that x = y (-) e is as
        likely as not on either side of it: x ~ N(m, P + F).
        """
        return apparent(belief, self.at(belief)) if self.numbers else belief

    @cached_property
    def _on_body(self) -> Float[Tensor, "6 6"]:
        """Of position in the camera's axes and attitude in the body's tangent."""
        if not self.numbers:
            return torch.zeros(6, 6)
        turn = torch.block_diag(torch.eye(3), self.mount.rotation)
        return turn @ torch.tensor(self.numbers).reshape(6, 6) @ turn.T
