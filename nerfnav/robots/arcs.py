"""Driving along arcs: displacement by speeds and headings, and the nearest ones that lead to a given place.

A step of dt at speed s, while the heading turns from psi to psi', moves a robot by

    q = s dt S(psi' - psi) e((psi + psi') / 2),   S(x) = sin(x/2) / (x/2)

With z the speeds and headings that are free, r(z) = sum q - away what is missed, J = dr/dz and W the squares of the
typical changes of z, Levenberg and Marquardt's method goes

    z <- z - W J' (J W J' + mu |r|^2 I)^-1 r

whose damping vanishes with what is missed, so that each round still squares that.
"""

import math
from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

TYPICAL_SPEED, TYPICAL_TURN = 0.5, 0.5
"""Changes of a speed [m/s] and a heading [rad] that change the motion much."""
ROUNDS = 20
"""Largest number of rounds; five or six are the rule."""
ARRIVED = 1e-6
"""Distance to the goal [m] from which one more round leaves nothing but rounding."""
EXACT = 1e-4
"""Distance to the goal [m] that is rounding."""
MU, LEAST = 1e-3, 1e-15
"""The damping's share of what is missed, and its smallest value [m^2]: at standstill J W J' has no inverse."""
SMALL = 0.02
"""Turn [rad] below which the derivatives of S are taken from their series."""

Path = Callable[[Tensor], tuple[Tensor, Tensor]]
"""Free numbers to speeds s_0 .. s_{N-1} and headings psi_0 .. psi_N."""


def unit(angle: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch 2"]:
    """Return the unit vector e(angle)."""
    return torch.stack([torch.cos(angle), torch.sin(angle)], -1)


def chord(turn: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """Compute S: the chord of an arc of unit length that turns by `turn` [rad]."""
    return torch.sinc(turn / (2 * math.pi))


def displacements(
    speeds: Float[Tensor, "*batch n"], yaw: Float[Tensor, "*batch times"], dt: float
) -> Float[Tensor, "*batch n 2"]:
    """Compute q of each step [m]."""
    turn, middle = yaw.diff(dim=-1), 0.5 * (yaw[..., :-1] + yaw[..., 1:])
    return (speeds * dt * chord(turn))[..., None] * unit(middle)


def closed(
    free: Float[Tensor, "*batch k"], path: Path, away: Float[Tensor, "2"], dt: float
) -> Float[Tensor, "*batch k"]:
    """Move the free numbers, speeds 1 .. N-1 and headings 2 .. N-1, to the nearest ones that lead `away` [m]."""
    numbers = free
    for _ in range(ROUNDS):
        speeds, yaw = path(numbers)
        missed = displacements(speeds, yaw, dt).sum(-2) - away
        numbers = numbers - _correction(speeds, yaw, missed, dt)
        if bool((missed.detach().abs() < ARRIVED).all()):
            break
    return numbers


def _correction(
    speeds: Float[Tensor, "*batch n"], yaw: Float[Tensor, "*batch times"], missed: Float[Tensor, "*batch 2"], dt: float
) -> Float[Tensor, "*batch k"]:
    """W J' (J W J' + mu |r|^2 I)^-1 r."""
    turn, middle = yaw.diff(dim=-1), 0.5 * (yaw[..., :-1] + yaw[..., 1:])
    along = unit(middle)
    across = torch.stack([-along[..., 1], along[..., 0]], -1)
    by_speed = (dt * chord(turn))[..., None] * along
    # d/dpsi of the arc that begins and of the one that ends at a heading
    bent = (speeds * dt * _chord_slope(turn))[..., None] * along
    swung = (0.5 * speeds * dt * chord(turn))[..., None] * across
    by_yaw = (swung - bent)[..., 2:, :] + (swung + bent)[..., 1:-1, :]
    jacobian = torch.cat([TYPICAL_SPEED * by_speed[..., 1:, :], TYPICAL_TURN * by_yaw], -2)
    damping = MU * missed.square().sum(-1)[..., None, None] + LEAST
    square = jacobian.transpose(-1, -2) @ jacobian + damping * torch.eye(2).to(jacobian)
    change = (jacobian @ torch.linalg.solve(square, missed[..., None]))[..., 0]
    count = speeds.shape[-1] - 1
    return torch.cat([TYPICAL_SPEED * change[..., :count], TYPICAL_TURN * change[..., count:]], -1)


def _chord_slope(turn: Tensor) -> Tensor:
    """dS / dx = (cos(x/2) - S) / x."""
    small = turn.abs() < SMALL
    safe = torch.where(small, torch.ones_like(turn), turn)
    series = -turn / 12 * (1 - turn.square() / 40 * (1 - turn.square() / 112))
    return torch.where(small, series, (torch.cos(0.5 * safe) - chord(safe)) / safe)
