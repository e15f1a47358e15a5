"""The rotation group SO(3): exponential, logarithm, retraction, quaternions.

Notation: theta is a rotation vector (axis times angle [rad]), R = Exp(theta) a rotation matrix, [theta]x the
skew-symmetric matrix with [theta]x v = theta x v. All functions take any batch shape, keep the dtype, and have
finite first and second derivatives everywhere but at angle pi of `log`: the pose filter takes an exact Hessian
at theta = 0, where closed forms divide zero by zero (Taylor series stand in below a small angle). Where no derivative
is asked for, compiled twins answer (rotations.py).

Formulas: Sola, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, Eqs. 131-147.
"""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.jit import Kernel, array_of
from nerfnav.geometry.rotations import exponentials, logarithms

Vector3 = Float[Tensor, "*batch 3"]
Matrix3 = Float[Tensor, "*batch 3 3"]

_SMALL_SQUARED_ANGLE = 1e-3  # the series below are exact to 1e-12 here


def hat(theta: Vector3) -> Matrix3:
    """The skew-symmetric matrix [theta]x (Sola Eq. 123)."""
    x, y, z = theta.unbind(-1)
    zero = torch.zeros_like(x)
    return torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*theta.shape[:-1], 3, 3)


def _sinc_terms(squared: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """sin(a)/a, (1 - cos(a))/a^2 and (a - sin(a))/a^3 as smooth functions of a^2."""
    small = squared < _SMALL_SQUARED_ANGLE
    series = torch.where(small, squared, torch.zeros_like(squared))
    first = 1 - series / 6 * (1 - series / 20 * (1 - series / 42))
    second = 0.5 - series / 24 * (1 - series / 30 * (1 - series / 56))
    third = 1 / 6 - series / 120 * (1 - series / 42 * (1 - series / 72))
    safe = torch.where(small, torch.ones_like(squared), squared)
    angle = safe.sqrt()
    sine, cosine = torch.sin(angle), torch.cos(angle)
    return (
        torch.where(small, first, sine / angle),
        torch.where(small, second, (1 - cosine) / safe),
        torch.where(small, third, (angle - sine) / (safe * angle)),
    )


def _needs_no_derivative(given: Tensor) -> bool:
    """Return True where a compiled twin can take the place of some fifty operations of torch, half a millisecond."""
    return given.device.type == "cpu" and not (given.requires_grad and torch.is_grad_enabled())


def _compiled(twin: Kernel, given: Tensor, shape: tuple[int, ...], made: tuple[int, ...]) -> Tensor:
    """Apply a compiled twin to a batch of arrays of a shape; returns arrays of the shape `made`."""
    batch = given.shape[: given.ndim - len(shape)]
    flat = array_of(given).reshape(-1, *shape)
    result = np.empty((len(flat), *made))
    twin(flat, result)
    return torch.from_numpy(result).reshape(*batch, *made).to(given.dtype)


def exp(theta: Vector3) -> Matrix3:
    """R = Exp(theta), Rodrigues' formula (Sola Eq. 132)."""
    if _needs_no_derivative(theta):
        return _compiled(exponentials, theta, (3,), (3, 3))
    first, second, _ = _sinc_terms(theta.square().sum(-1))
    skew = hat(theta)
    identity = torch.eye(3, dtype=theta.dtype, device=theta.device)
    return identity + first[..., None, None] * skew + second[..., None, None] * (skew @ skew)


def log(rotation: Matrix3) -> Vector3:
    """theta = Log(R), the rotation vector with angle in [0, pi] (Sola Eq. 133).

    Near pi the axis is read from the quaternion, which is well conditioned there.
    """
    if _needs_no_derivative(rotation):
        return _compiled(logarithms, rotation, (3, 3), (3,))
    quaternion = quaternion_from_matrix(rotation)
    w, vector = quaternion[..., 0], quaternion[..., 1:]
    squared = vector.square().sum(-1)
    small = squared < _SMALL_SQUARED_ANGLE
    series = torch.where(small, squared, torch.zeros_like(squared))
    # 2 asin(s)/s in s^2, with s = |vector| and w >= 0
    near = 2 * (1 + series / 6 * (1 + series * 9 / 20 * (1 + series * 25 / 42)))
    safe = torch.where(small, torch.ones_like(squared), squared)
    norm = safe.sqrt()
    far = 2 * torch.atan2(norm, w) / norm
    return torch.where(small, near, far)[..., None] * vector


def right_jacobian(theta: Vector3) -> Matrix3:
    """Jr with Exp(theta + d) = Exp(theta) Exp(Jr d) to first order (Sola Eq. 143)."""
    _, second, third = _sinc_terms(theta.square().sum(-1))
    skew = hat(theta)
    identity = torch.eye(3, dtype=theta.dtype, device=theta.device)
    return identity - second[..., None, None] * skew + third[..., None, None] * (skew @ skew)


def retract(rotation: Matrix3, theta: Vector3) -> Matrix3:
    """R (+) theta = R Exp(theta): theta is in the body (right) tangent of R (Sola Eq. 25)."""
    return rotation @ exp(theta)


def local(rotation: Matrix3, other: Matrix3) -> Vector3:
    """other (-) R = Log(R' other), the inverse of `retract` (Sola Eq. 26)."""
    return log(rotation.transpose(-1, -2) @ other)


def project(matrix: Matrix3) -> Matrix3:
    """The rotation nearest to `matrix` (Frobenius norm): takes rounding drift out of long products."""
    u, _, vt = torch.linalg.svd(matrix)
    sign = torch.det(u @ vt)
    scale = torch.stack([torch.ones_like(sign), torch.ones_like(sign), sign], -1)
    return u * scale[..., None, :] @ vt


def from_yaw(yaw: Float[Tensor, "*batch"]) -> Matrix3:
    """The rotation about the world's z axis by `yaw` [rad]."""
    cosine, sine, zero, one = yaw.cos(), yaw.sin(), torch.zeros_like(yaw), torch.ones_like(yaw)
    return torch.stack([cosine, -sine, zero, sine, cosine, zero, zero, zero, one], -1).reshape(*yaw.shape, 3, 3)


def from_roll_pitch_yaw(angles: Vector3) -> Matrix3:
    """Turn about the x axis, then y, then z of the world, by angles [rad]."""
    x, y, z = (exp(angles[..., axis, None] * torch.eye(3).to(angles)[axis]) for axis in range(3))
    return z @ y @ x


def yaw_of(rotation: Matrix3) -> Float[Tensor, "*batch"]:
    """The heading of the body's x axis in the world's xy plane [rad]."""
    return torch.atan2(rotation[..., 1, 0], rotation[..., 0, 0])


def quaternion_from_matrix(rotation: Matrix3) -> Float[Tensor, "*batch 4"]:
    """The unit quaternion (w, x, y, z), w >= 0, of a rotation matrix.

    Shepperd's method: of the four ways to extract it, the one whose divisor is largest.
    """
    m = rotation
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    diagonal = torch.diagonal(m, dim1=-2, dim2=-1)
    squares = torch.cat([trace[..., None], 2 * diagonal - trace[..., None]], -1) + 1  # 4 q_i^2
    xy, yz, zx = m[..., 1, 0] + m[..., 0, 1], m[..., 2, 1] + m[..., 1, 2], m[..., 0, 2] + m[..., 2, 0]
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    products = torch.stack(  # 4 q_i q_j
        [
            torch.stack([squares[..., 0], wx, wy, wz], -1),
            torch.stack([wx, squares[..., 1], xy, zx], -1),
            torch.stack([wy, xy, squares[..., 2], yz], -1),
            torch.stack([wz, zx, yz, squares[..., 3]], -1),
        ],
        -2,
    )
    best = squares.argmax(-1)[..., None, None].expand(*squares.shape[:-1], 1, 4)
    row = torch.gather(products, -2, best).squeeze(-2)
    divisor = torch.gather(squares, -1, best[..., 0, :1]).clamp_min(1e-12).sqrt()
    quaternion = row / (2 * divisor)
    return torch.where(quaternion[..., :1] < 0, -quaternion, quaternion)


def matrix_from_quaternion(quaternion: Float[Tensor, "*batch 4"]) -> Matrix3:
    """The rotation matrix of a quaternion (w, x, y, z), which is normalised first."""
    w, x, y, z = torch.nn.functional.normalize(quaternion, dim=-1).unbind(-1)
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ]  # fmt: skip
    return torch.stack(rows, -1).reshape(*quaternion.shape[:-1], 3, 3)
