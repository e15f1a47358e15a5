"""Confidence ellipsoid: the region that holds 95 % of a normal distribution in space.

A covariance V diag(l) V' has the axes V, and half lengths sqrt(l) times the root of the 95 % quantile of the
chi-squared distribution with three degrees of freedom.
"""

import torch
from jaxtyping import Float
from torch import Tensor

_CHI_95 = 2.7955


def ellipsoid_95(
    covariance: Float[Tensor, "*batch 3 3"],
) -> tuple[Float[Tensor, "*batch 3 3"], Float[Tensor, "*batch 3"]]:
    """The rotation whose columns are the axes of an ellipsoid, and half its lengths along them, in double precision."""
    variances, axes = torch.linalg.eigh(covariance.detach().double())
    mirrored = torch.linalg.det(axes) < 0
    return torch.where(mirrored[..., None, None], -axes, axes), _CHI_95 * variances.clamp_min(0).sqrt()
