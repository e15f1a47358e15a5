"""Errors of a belief, and whether it knew of them."""

import torch

from nerfnav.estimator import Belief
from nerfnav.estimator.covariance import POSE
from nerfnav.experiments.estimation_results import ERRORS
from nerfnav.experiments.study import Row
from nerfnav.robots import RigidState

_ELLIPSOID_95 = 7.815
"""95 % of a chi-squared of three numbers."""


def errors_of(belief: Belief, truth: RigidState) -> Row:
    """How far off a belief is, and whether it knew."""
    error = belief.mean.local(truth)
    covariance = belief.covariance.double()

    def nees(index: list[int]) -> float:
        part = error[index].double()
        return (part @ torch.linalg.solve(covariance[index][:, index], part)).item()

    lengths = {name: error[part].norm().item() for name, part in ERRORS.items()}
    place = nees([0, 1, 2])
    return lengths | {"nees_pose": nees(POSE), "nees": nees([*range(12)]), "inside_95": place < _ELLIPSOID_95}
