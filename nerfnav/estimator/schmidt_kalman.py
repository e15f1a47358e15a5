"""Schmidt-Kalman filter: the error of the map as a "consider" covariance, which does not average out (Schmidt 1966).

A picture fits best at y = x (+) e, with x the true state and e ~ N(0, F) what the field is wrong by there (F in the
tangent, see map_error.py). So with x- ~ N(mu-, P), a filter that compares pictures is given S = P + F, and what it
finds, y+ ~ N(m, C), moves x by its regression on y:

    G = P S^-1,   mu+ = mu- (+) G (m (-) mu-),   P+ = P - G (S - C) G'

What is told of x+ is P+ + F: in the next picture the field is wrong by about the same, so that it does not average
out.

`ConsiderCovariance` holds F of one field and one camera, and turns it into the tangent of a state.
"""


from dataclasses import dataclass, replace
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.covariance import POSE
from nerfnav.estimator.core.prediction import estimate_noise_scale
from nerfnav.geometry import FORWARD_MOUNT, Pose, so3
from nerfnav.robots import ProcessNoise

_TRUST = 1.5
"""How well the size of process noise is known beforehand: degrees of freedom (see prediction.py)."""
_Square = Float[Tensor, "12 12"]


def add_consider_covariance(belief: Belief, floor: _Square) -> Belief:
    """Where the field should show what is believed."""
    return Belief(belief.mean, belief.covariance + floor)


def correct_schmidt_kalman(found: Belief, before: Belief, floor: _Square, noise: ProcessNoise) -> Belief:
    """x+, for what was found from `apparent(before, floor)`; `before` holds this process noise once."""
    change = before.mean.local(found.mean).double()
    held, spread = before.covariance.double(), found.covariance.double()
    shown = held + floor.double()
    pose = shown[POSE][:, POSE].inverse()
    told = spread[POSE][:, POSE].inverse() - pose
    size = max(1.0, estimate_noise_scale(change[POSE], pose, told, _TRUST))
    more = (size - 1) * noise.covariance().double()
    held, shown = held + more, shown + more
    gain = torch.linalg.solve(shown, held).T
    covariance = held - gain @ (shown - spread) @ gain.T
    mean = before.mean.retract((gain @ change).to(before.mean.position))
    mean = replace(mean, rotation=so3.project(mean.rotation))
    return Belief(mean, (0.5 * (covariance + covariance.T)).to(before.covariance))


@dataclass(frozen=True)
class ConsiderCovariance:
    """Of one field and one camera."""

    numbers: tuple[float, ...] = ()
    """6 x 6, row by row, in the camera's axes (see estimator/map_error.py); none: there is none."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""

    def at(self, belief: Belief) -> Float[Tensor, "12 12"]:
        """F, where the camera is believed to be."""
        turn = torch.block_diag(belief.mean.pose.compose(self.mount).rotation, torch.eye(3))
        floor, pose = torch.zeros_like(belief.covariance), torch.tensor(POSE)
        floor[pose[:, None], pose] = turn @ self._on_body @ turn.T
        return floor

    def beside(self, belief: Belief) -> Belief:
        """One of x and y = x (+) e, as schmidt_kalman.py has them, from a belief of the other, where pictures have told
        it.

        While e stays the same, y moves as x does and the field shows y without an error: a filter that knows nothing of
        e follows y, y ~ N(m, P), as quickly as it should. Of e no picture tells anything, so that x = y (-) e is as
        likely as not on either side of it: x ~ N(m, P + F).
        """
        return add_consider_covariance(belief, self.at(belief)) if self.numbers else belief

    @cached_property
    def _on_body(self) -> Float[Tensor, "6 6"]:
        """Of position in the camera's axes and attitude in the body's tangent."""
        if not self.numbers:
            return torch.zeros(6, 6)
        turn = torch.block_diag(torch.eye(3), self.mount.rotation)
        return turn @ torch.tensor(self.numbers).reshape(6, 6) @ turn.T
