"""Map error: covariance of pose errors that pictures do not average out, estimated from held-out photographs.

Where a field is wrong, all pictures of a place err alike, so the error of a pose does not average out (Schmidt
1966, "consider" covariance, see schmidt_kalman.py). It is measured on held-out photographs: each is fitted from
random poses around its own, as the tracker does, which ends e_i = (R' (p^ - p), Log(R' R^)) from the true pose,
position [m] and turn [rad] in the camera's axes, in which a shift and a turn that look alike go together. What a
filter would say of these errors by itself, C_i, is in its posterior already, and must not be counted twice:

    e_i ~ N(0, F + C_i)

and F is the likeliest (random effects; by expectation and maximisation, Dempster, Laird and Rubin 1977, Sec. 4.5).

Where the truth is known, a floor of positions alone shows as well. A field puts its surfaces a little beside their
places, by no share of the distance of its nodes that would be the same for all fields. With C_i what the filter says,
errors of position are e_i ~ N(0, C_i + f^2 I), and f is the likeliest (`fit_position_bias`).
"""


from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.estimator.photometric.direct_alignment import AlignConfig, fit_pose
from nerfnav.estimator.photometric.levenberg_marquardt import (
    Guess,
    Iterate,
    Prior,
    join_information,
    picture_information,
)
from nerfnav.estimator.photometric.pyramid import PyramidConfig, View
from nerfnav.estimator.photometric.residuals import ColorNoise, count_patches
from nerfnav.field import Field
from nerfnav.geometry import Camera, Pose, PosedImages, downsample_image, so3

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
_FITS = 2
"""Times that each is fitted, from where the last fit ended: a filter that follows begins as near."""
_ROUNDS = 60
"""Of expectation and maximisation."""
_EXPOSURE = (0.1, 0.05)
_LONGEST = 320
_ITSELF = Pose(torch.eye(3), torch.zeros(3))


@torch.no_grad()
def measure_map_error(
    field: Field, photographs: PosedImages, noise: ColorNoise, generator: torch.Generator
) -> tuple[float, ...]:
    """F, 36 numbers row by row; none where too few photographs can be fitted."""
    size = float(field.box.size.max())
    spread = torch.tensor([_SPREAD * size] * 3 + [_SPREAD / _DEPTH] * 3)
    found = _ends(field, photographs, noise, (spread, generator))
    ends = [end for end in found if (end[0].abs() < _ASTRAY * spread).all()]
    if len(ends) < _FEWEST:
        return ()
    errors, told = (torch.stack(part).double() for part in zip(*ends, strict=True))
    covariance = fit_map_error(errors, told)
    covariance = (1 - _SHRUNK) * covariance + _SHRUNK * torch.diag(covariance.diagonal())
    return tuple(covariance.flatten().tolist())


def fit_map_error(errors: Float[Tensor, "n 6"], told: Float[Tensor, "n 6 6"]) -> Float[Tensor, "6 6"]:
    """F, for errors whose covariances are `told` as C_i."""
    covariance = errors.T @ errors / len(errors)
    for _ in range(_ROUNDS):
        gain = covariance @ torch.linalg.inv(covariance + told)
        shared = (gain @ errors[..., None])[..., 0]
        covariance = (shared.T @ shared + (covariance - gain @ covariance).sum(0)) / len(errors)
        covariance = 0.5 * (covariance + covariance.T)
    return covariance


def _ends(
    field: Field, photographs: PosedImages, noise: ColorNoise, start: tuple[Float[Tensor, "6"], torch.Generator]
) -> Iterator[tuple[Float[Tensor, "6"], Float[Tensor, "6 6"]]]:
    """Errors e_i of the fits of each photograph, from random poses around its own, and C_i."""
    spread, generator = start
    camera = reduce_camera(photographs.camera)
    view, depth = View((field,), camera, _ITSELF), _DEPTH * float(field.box.size.max())
    beside = camera.fx * float(spread[3:].norm() + spread[:3].norm() / depth)
    every = max(1, -(-len(photographs) // _VIEWS))

    for index in range(0, len(photographs), every):
        true = photographs.poses[index]
        image = resize_picture(photographs.images[index], camera)
        judged = _Judged(
            noise, count_patches(image), PyramidConfig().misplaced * view.grain / noise.std, _ASTRAY * spread
        )
        for draw in spread * torch.randn(_STARTS, 6, generator=generator):
            begun = Pose(so3.retract(true.rotation, draw[3:])[None], (true.position + true.rotation @ draw[:3])[None])
            last = None
            for _ in range(_FITS):
                last, _ = fit_pose(image, view, (Guess.at(begun), beside), judged.known, (AlignConfig(), generator))
                begun = last.guess.pose
            assert last is not None, "each is fitted at least once"
            found = begun[0]
            moved = (found.position - true.position) @ true.rotation
            error = torch.cat([moved, so3.local(true.rotation, found.rotation)])
            yield error, judged.told(last, found.rotation)


@dataclass(frozen=True)
class _Judged:
    """What a filter makes of one photograph (see update.py)."""

    noise: ColorNoise
    patches: float
    slack: float
    reach: Float[Tensor, "6"]
    """What is told where a photograph says nothing: a standard deviation [m, rad]."""

    def known(self, pixels: int) -> Prior:
        """Nothing but the exposure."""
        kappa = 1 / (self.noise.alike_of(pixels, self.patches) * self.noise.std**2)
        return Prior(join_information(None, _EXPOSURE), None, kappa, self.slack)

    def told(self, end: Iterate, rotation: Float[Tensor, "3 3"]) -> Float[Tensor, "6 6"]:
        """C of where a fit ends, in the camera's axes."""
        colors = end.residual[0].numel()
        squares = float(end.cost[0] - end.process[0]) / self.known(colors // 3).kappa / colors
        axes = torch.block_diag(rotation, torch.eye(3)).double()
        information = axes.T @ picture_information(end).double() @ axes / self.noise.doubt(squares, self.patches)
        return torch.linalg.inv(information + torch.diag(self.reach.double() ** -2))


def reduce_camera(camera: Camera, longest: int = _LONGEST) -> Camera:
    """The camera with no more pixels along its longer edge than a field shows more of."""
    return camera.scaled(min(1.0, longest / max(camera.width, camera.height)))


def resize_picture(image: UInt8[Tensor, "height width 3"], camera: Camera) -> UInt8[Tensor, "h w 3"]:
    """A picture with the pixels of another resolution of its camera."""
    if tuple(image.shape[:2]) == (camera.height, camera.width):
        return image
    return (255 * downsample_image(image, camera)).round().to(torch.uint8).reshape(camera.height, camera.width, 3)


def rescale_map_error(floor: tuple[float, ...], scale: float) -> tuple[float, ...]:
    """F of a place whose metre of before is `scale` metres now."""
    if not floor:
        return floor
    sizes = torch.tensor([scale] * 3 + [1.0] * 3, dtype=torch.float64)
    matrix = torch.tensor(floor, dtype=torch.float64).reshape(6, 6)
    return tuple((sizes[:, None] * matrix * sizes).flatten().tolist())


def fit_position_bias(errors: Float[np.ndarray, "n 3"], told: Float[np.ndarray, "n 3 3"]) -> float:
    """f [m], for errors [m] of which the filter says C_i [m^2]; 0 where that explains them all."""
    variances, axes = np.linalg.eigh(told)
    along = np.einsum("nij,ni->nj", axes, errors)  # in the axes of C_i, where C_i + f^2 I is diagonal

    def unlikelihood(floor: float) -> float:
        more = variances + floor**2
        return float((np.log(more) + along**2 / more).sum())

    bounds = (0.0, float(np.abs(along).max()))
    found = scipy.optimize.minimize_scalar(unlikelihood, bounds=bounds, method="bounded", options={"xatol": 1e-7})
    return float(found.x) if found.fun < unlikelihood(0.0) else 0.0
