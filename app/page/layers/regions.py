"""95 % regions of beliefs, as arrays that are drawn: ellipsoids of the position, cones of the attitude."""

import numpy as np
import torch
import viser.transforms as tf

from nerfnav.estimator import Belief
from nerfnav.geometry import ellipsoid_95
from nerfnav.robots import ATTITUDE, POSITION

_NOSE, _RIM = 0.2, 12  # length [m] and number of the lines that show where the nose may point
_LEAST_AXIS = 1e-4  # [m]: a flat ellipsoid has no rotation


def ellipsoids(beliefs: list[Belief]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (n, 3) [m], attitudes (n, 4) and half axes (n, 3) [m] of the 95 % ellipsoids of the positions."""
    if not beliefs:
        return np.zeros((0, 3)), np.zeros((0, 4)), np.zeros((0, 3))
    centers = np.stack([belief.mean.position.detach().numpy() for belief in beliefs])
    axes, half = ellipsoid_95(torch.stack([belief.covariance[POSITION, POSITION] for belief in beliefs]))
    return centers, tf.SO3.from_matrix(axes.numpy()).wxyz, np.maximum(half.numpy(), _LEAST_AXIS)


def cone(belief: Belief, scale: float = 1.0) -> np.ndarray:
    """Segments (n, 2, 3) [m] from the believed position to where its nose may point, on the rim of the 95 % region."""
    axes, lengths = ellipsoid_95(belief.covariance[ATTITUDE, ATTITUDE])
    half = scale * (axes * lengths).numpy()
    angles = np.linspace(0, 2 * np.pi, _RIM, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], -1)
    rim = np.concatenate([circle @ half[:, pair].T for pair in ([0, 1], [1, 2], [0, 2])])
    turned = belief.mean.rotation.double().numpy() @ tf.SO3.exp(rim).as_matrix()
    start = belief.mean.position.detach().double().numpy()
    return np.stack([np.broadcast_to(start, (len(turned), 3)), start + _NOSE * turned[:, :, 0]], 1)
