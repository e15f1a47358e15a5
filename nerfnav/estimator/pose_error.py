"""What no number of pictures improves upon: how far the poses that fit pictures best are from the true ones.

Where a field is wrong, all pictures of a place err alike, so the error of a pose does not average out (Schmidt 1966,
"consider" covariance; here it is added to the posterior of each update). It is measured on held-out photographs: each
is fitted from random poses around its own, as a filter would, and the spread of where that ends is taken,

    F = E[e e'],   e = (R' (p^ - p), Log(R' R^)),

position [m] and turn [rad] in the camera's axes, in which a shift and a turn that look alike go together.
"""

from collections.abc import Iterator

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.descents import improve
from nerfnav.estimator.newton import Guess, NewtonConfig, Prior, joined
from nerfnav.estimator.photometric import ColorNoise
from nerfnav.estimator.pyramid import small_observation
from nerfnav.field import Field
from nerfnav.geometry import Camera, Pose, PosedImages, so3

_VIEWS, _STARTS = 16, 4
"""Photographs that are fitted at most, and from how many poses each."""
_SPREAD, _DEPTH = 0.004, 0.3
"""Standard deviation of a coordinate of those, as predictions have it (a centimetre in a room), and how far off things
are [shares of the box's longest edge]."""
_ASTRAY = 6.0
"""Fits that end further away than this many of those, along some coordinate, are of another minimum."""
_FEWEST = 8
"""Fits that tell a spread."""
_SHRUNK = 0.2
"""Share of the diagonal in the result: few fits tell too much of how coordinates go together."""
_PIXELS, _ROBUST, _STEPS = 1024, 0.1, 12
_EXPOSURE = (0.1, 0.05)
_LONGEST = 320
_ITSELF = Pose(torch.eye(3), torch.zeros(3))


@torch.no_grad()
def pose_floor(
    field: Field, photographs: PosedImages, noise: ColorNoise, generator: torch.Generator
) -> tuple[float, ...]:
    """F, 36 numbers row by row; none where too few photographs can be fitted."""
    size = float(field.box.size.max())
    spread = torch.tensor([_SPREAD * size] * 3 + [_SPREAD / _DEPTH] * 3)
    ends = list(_ends(field, photographs, noise, (spread, generator)))
    errors = torch.cat([torch.zeros(0, 6), *ends])
    errors = errors[(errors.abs() < _ASTRAY * spread).all(1)].double()
    if len(errors) < _FEWEST:
        return ()
    covariance = errors.T @ errors / len(errors)
    covariance = (1 - _SHRUNK) * covariance + _SHRUNK * torch.diag(covariance.diagonal())
    return tuple(covariance.flatten().tolist())


def _ends(
    field: Field, photographs: PosedImages, noise: ColorNoise, start: tuple[Float[Tensor, "6"], torch.Generator]
) -> Iterator[Float[Tensor, "s 6"]]:
    """Errors of the fits of each photograph, from random poses around its own."""
    spread, generator = start
    camera = comparable(photographs.camera)
    every = max(1, -(-len(photographs) // _VIEWS))
    for index in range(0, len(photographs), every):
        true = photographs.poses[index]
        seen = small_observation(photographs.images[index], (field, camera, _ITSELF), _PIXELS, generator)
        kappa = 1 / ((1 + len(seen.pixels) / (noise.per_patch * noise.few_patches)) * noise.std**2)
        draws = spread * torch.randn(_STARTS, 6, generator=generator)
        begun = Pose(
            so3.retract(true.rotation.expand(_STARTS, 3, 3), draws[:, 3:]),
            true.position + draws[:, :3] @ true.rotation.T,
        )
        prior = Prior(joined(None, _EXPOSURE), None, kappa)
        *_, last = improve(seen, Guess.at(begun), prior, NewtonConfig(_STEPS, robust=_ROBUST))
        moved = (last.guess.pose.position - true.position) @ true.rotation
        yield torch.cat([moved, so3.local(true.rotation.expand(_STARTS, 3, 3), last.guess.pose.rotation)], 1)


def comparable(camera: Camera, longest: int = _LONGEST) -> Camera:
    """The camera with no more pixels along its longer edge than a field shows more of."""
    return camera.scaled(min(1.0, longest / max(camera.width, camera.height)))


def rescaled(floor: tuple[float, ...], scale: float) -> tuple[float, ...]:
    """F of a place whose metre of before is `scale` metres now."""
    if not floor:
        return floor
    sizes = torch.tensor([scale] * 3 + [1.0] * 3, dtype=torch.float64)
    matrix = torch.tensor(floor, dtype=torch.float64).reshape(6, 6)
    return tuple((sizes[:, None] * matrix * sizes).flatten().tolist())
