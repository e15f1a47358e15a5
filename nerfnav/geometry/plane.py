"""Planes: through three points, and the one that most of many points lie on (RANSAC).

Notation: a plane holds the points p with n . p = d, n its unit normal.
Fischler, Bolles, "Random sample consensus", Communications of the ACM, 1981.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError

_LINE = 0.02
"""Height of a triangle, relative to its longest side, below which its corners count as lying on a line."""


@dataclass(frozen=True)
class Plane:
    """All points p with normal . p = offset."""

    normal: Float[Tensor, "3"]
    """n, of length 1, in double precision."""
    offset: float
    """d [m]."""

    def heights(self, points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch"]:
        """Signed distances of points [m], positive on the side of the normal [m]."""
        return points.double() @ self.normal - self.offset

    def facing(self, direction: Float[Tensor, "3"]) -> "Plane":
        """The same plane with its normal on the side of `direction`."""
        return self if float(self.normal @ direction.double()) >= 0 else Plane(-self.normal, -self.offset)


@dataclass(frozen=True)
class RansacConfig:
    """Settings of RANSAC for a plane."""

    draws: int = 400
    """Number of triples of points that are tried."""
    sample: int = 4000
    """Points that each of them is judged by."""
    tolerance: float = 0.01
    """Distance at which a point still lies on a plane [m]."""
    tilt: float = 0.5
    """Largest angle between the plane's normal and the assumed up direction [rad]."""
    below: float = 0.05
    """Share of all points that may lie below the plane: things stand on a floor."""
    least: float = 0.05
    """Share of all points that must lie on it."""


def plane_through(points: Float[Tensor, "3 3"]) -> Plane:
    """The plane through three points [m]. Raises InvalidInputError where they lie on one line."""
    points = points.double()
    sides = points - points.roll(1, 0)
    across = torch.linalg.cross(sides[0], sides[1])
    longest = float(sides.norm(dim=-1).max())
    if not float(across.norm()) > _LINE * longest**2:
        raise InvalidInputError(
            "the three points of the floor lie on one line, or two of them are the same: choose a wide triangle"
        )
    normal = across / across.norm()
    return Plane(normal, float(normal @ points.mean(0)))


def fit_plane(
    points: Float[Tensor, "n 3"],
    up: Float[Tensor, "3"],
    generator: torch.Generator,
    config: RansacConfig | None = None,
) -> Plane | None:
    """The lowest plane that many points [m] lie on, its normal near `up`; None where there is none.

    Among planes with little below them, that with the most points on it, fitted to these by least squares.
    """
    config = config or RansacConfig()
    if len(points) < 3:
        return None
    sample = points[torch.randperm(len(points), generator=generator)[: config.sample]].double()
    normals, offsets = _candidates(sample, up.double(), generator, config)
    if len(normals) == 0:
        return None
    heights = normals @ sample.T - offsets[:, None]
    on = (heights.abs() < config.tolerance).double().mean(1)
    below = (heights < -2 * config.tolerance).double().mean(1)
    on = torch.where(below <= config.below, on, torch.zeros_like(on))
    best = int(on.argmax())
    if on[best] < config.least:
        return None
    plane = Plane(normals[best], float(offsets[best]))
    return _fitted(points[plane.heights(points).abs() < config.tolerance]).facing(up)


def _candidates(
    sample: Float[Tensor, "n 3"], up: Float[Tensor, "3"], generator: torch.Generator, config: RansacConfig
) -> tuple[Float[Tensor, "k 3"], Float[Tensor, " k"]]:
    """Unit normals and offsets of planes through random triples, those that are level enough."""
    triples = sample[torch.randint(len(sample), (config.draws, 3), generator=generator)]
    across = torch.linalg.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    lengths = across.norm(dim=-1, keepdim=True)
    normals = across / lengths.clamp_min(1e-12)
    normals = normals * torch.sign(normals @ up)[:, None]
    level = (lengths[:, 0] > 0) & (normals @ (up / up.norm()) > torch.cos(torch.tensor(config.tilt)))
    return normals[level], (normals * triples.mean(1)).sum(-1)[level]


def _fitted(points: Float[Tensor, "n 3"]) -> Plane:
    """The plane with the least sum of squared distances."""
    middle = points.double().mean(0)
    normal = torch.linalg.svd(points.double() - middle, full_matrices=False).Vh[2]
    return Plane(normal, float(normal @ middle))
