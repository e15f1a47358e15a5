"""Map error: covariance of pose errors that pictures do not average out, measured, and considered by the filter.

Schmidt-Kalman filter (Schmidt 1966): a field is wrong by about the same in all pictures of a place, so the map error
e ~ N(0, F) is a "consider" state, whose covariance counts and is never reduced. A picture fits best at y = x (+) e,
with x the true state. So with x- ~ N(mu-, P), a filter that compares pictures is given S = P + F, and its posterior,
y+ ~ N(m, C), moves x by its regression on y:

    G = P S^-1,   mu+ = mu- (+) G (m (-) mu-),   P+ = P - G (S - C) G'

The reported covariance of x+ is P+ + F.

F is measured on held-out photographs: each is fitted from random poses around its own, as the tracker does, which ends
e_i = (R' (p^ - p), Log(R' R^)) from the true pose, position [m] and turn [rad] in the camera's axes, in which a shift
and a turn that look alike go together. The filter's own covariance of these errors, C_i, is in its posterior already,
and must not be counted twice:

    e_i ~ N(0, F + C_i)

and F is the likeliest (random effects; by expectation and maximisation, Dempster, Laird and Rubin 1977, Sec. 4.5).

Position bias: where the truth is known, the part of the map error that shifts positions shows as well. A field puts
its surfaces a little beside their places, by no share of the distance of its nodes that would be the same for all
fields. With C_i the filter's covariances, errors of position are e_i ~ N(0, C_i + f^2 I), and f is the likeliest.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.deadline import Deadline
from nerfnav.estimator.core.belief import POSE, Belief
from nerfnav.estimator.core.filter_config import FastConfig, exposure_prior
from nerfnav.estimator.core.prediction import estimate_noise_scale
from nerfnav.estimator.photometric.direct_alignment import AlignConfig, fit_pose
from nerfnav.estimator.photometric.levenberg_marquardt import (
    Guess,
    Iterate,
    Prior,
    picture_information,
)
from nerfnav.estimator.photometric.pyramid import PyramidConfig, View, reduce_camera, resize_picture
from nerfnav.estimator.photometric.residuals import ColorNoise, count_patches
from nerfnav.field import Field
from nerfnav.geometry import FORWARD_MOUNT, Pose, PosedImages, so3
from nerfnav.robots import ProcessNoise

_VIEWS, _STARTS = 16, 4
"""Photographs that are fitted at most, and starts of each."""
_DEVIATION, _DEPTH = 0.004, 0.3
"""Standard deviation of a coordinate of the starts, as predictions have it (a centimetre in a room), and typical depth
[shares of the box's longest edge]."""
_ASTRAY = 6.0
"""Fits that end further away than this many of those, along some coordinate, are of another minimum."""
_FEWEST = 8
"""Fewest fits that give a covariance."""
_SHRUNK = 0.2
"""Share of the diagonal in the result: few fits overstate correlations."""
_FITS = 2
"""Fits in sequence, each from the end of the last: a filter that follows begins as near."""
_ROUNDS = 60
"""Rounds of expectation and maximisation."""
_ITSELF = Pose(torch.eye(3), torch.zeros(3))


@dataclass(frozen=True)
class ConsiderCovariance:
    """Map error of one field and one camera."""

    numbers: tuple[float, ...] = ()
    """F, 6 x 6, row by row, in the camera's axes (see `measure_map_error`); empty: no map error."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""

    def at(self, belief: Belief) -> Float[Tensor, "12 12"]:
        """Return F in the tangent of a belief."""
        turn = torch.block_diag(belief.mean.pose.compose(self.mount).rotation, torch.eye(3))
        covariance, pose = torch.zeros_like(belief.covariance), torch.tensor(POSE)
        covariance[pose[:, None], pose] = turn @ self._on_body @ turn.T
        return covariance

    def beside(self, belief: Belief) -> Belief:
        """Convert a belief of x to one of y = x (+) e, or back, after pictures of the place.

        While e stays the same, y moves as x does and the field shows y without an error: a filter without a map error
        follows y, y ~ N(m, P), as quickly as it should. Pictures say nothing of e, so that x = y (-) e is as likely on
        either side of it: x ~ N(m, P + F).
        """
        return add_consider_covariance(belief, self.at(belief)) if self.numbers else belief

    @cached_property
    def _on_body(self) -> Float[Tensor, "6 6"]:
        """F for the position in the camera's axes and the attitude in the body's tangent."""
        if not self.numbers:
            return torch.zeros(6, 6)
        turn = torch.block_diag(torch.eye(3), self.mount.rotation)
        return turn @ torch.tensor(self.numbers).reshape(6, 6) @ turn.T


def add_consider_covariance(belief: Belief, map_error: Float[Tensor, "12 12"]) -> Belief:
    """Return the belief of y, at which a picture fits best."""
    return Belief(belief.mean, belief.covariance + map_error)


def correct_schmidt_kalman(
    found: Belief, before: Belief, map_error: Float[Tensor, "12 12"], noise: ProcessNoise
) -> Belief:
    """Return x+ for the posterior of `add_consider_covariance(before, map_error)`; `before` holds `noise` once."""
    change = before.mean.local(found.mean).double()
    held, posterior = before.covariance.double(), found.covariance.double()
    shown = held + map_error.double()
    pose = shown[POSE][:, POSE].inverse()
    seen = posterior[POSE][:, POSE].inverse() - pose
    size = max(1.0, estimate_noise_scale(change[POSE], pose, seen, FastConfig.noise_trust))
    more = (size - 1) * noise.covariance().double()
    held, shown = held + more, shown + more
    gain = torch.linalg.solve(shown, held).T
    covariance = held - gain @ (shown - posterior) @ gain.T
    mean = before.mean.retract((gain @ change).to(before.mean.position))
    mean = replace(mean, rotation=so3.project(mean.rotation))
    return Belief(mean, (0.5 * (covariance + covariance.T)).to(before.covariance))


@torch.no_grad()
def measure_map_error(
    field: Field,
    photographs: PosedImages,
    noise: ColorNoise,
    generator: torch.Generator,
    until: Deadline | None = None,
) -> tuple[float, ...]:
    """Return F, 36 numbers row by row; empty where too few photographs can be fitted.

    With `until`, the photographs come in random order, and after the fewest fits that are needed those end it that are
    left.
    """
    if until is not None:
        photographs = photographs.subset(torch.randperm(len(photographs), generator=generator).tolist())
    size = float(field.box.size.max())
    deviations = torch.tensor([_DEVIATION * size] * 3 + [_DEVIATION / _DEPTH] * 3)
    ends = []
    for end in _fit_photographs(field, photographs, noise, deviations, generator):
        if (end[0].abs() < _ASTRAY * deviations).all():
            ends.append(end)
        if until is not None and len(ends) >= _FEWEST and until.left_s <= 0:
            break
    if len(ends) < _FEWEST:
        return ()
    errors, reported = (torch.stack(part).double() for part in zip(*ends, strict=True))
    covariance = fit_map_error(errors, reported)
    covariance = (1 - _SHRUNK) * covariance + _SHRUNK * torch.diag(covariance.diagonal())
    return tuple(covariance.flatten().tolist())


def fit_map_error(errors: Float[Tensor, "n 6"], reported: Float[Tensor, "n 6 6"]) -> Float[Tensor, "6 6"]:
    """Return F for errors with the `reported` covariances C_i."""
    covariance = errors.T @ errors / len(errors)
    for _ in range(_ROUNDS):
        gain = covariance @ torch.linalg.inv(covariance + reported)
        shared = (gain @ errors[..., None])[..., 0]
        covariance = (shared.T @ shared + (covariance - gain @ covariance).sum(0)) / len(errors)
        covariance = 0.5 * (covariance + covariance.T)
    return covariance


def rescale_map_error(numbers: tuple[float, ...], scale: float) -> tuple[float, ...]:
    """Return F for a place whose old metre is `scale` metres now."""
    if not numbers:
        return numbers
    sizes = torch.tensor([scale] * 3 + [1.0] * 3, dtype=torch.float64)
    matrix = torch.tensor(numbers, dtype=torch.float64).reshape(6, 6)
    return tuple((sizes[:, None] * matrix * sizes).flatten().tolist())


def fit_position_bias(errors: Float[np.ndarray, "n 3"], reported: Float[np.ndarray, "n 3 3"]) -> float:
    """Return f [m] for errors [m] with the `reported` covariances C_i [m^2]; 0 where those explain all errors."""
    variances, axes = np.linalg.eigh(reported)
    along = np.einsum("nij,ni->nj", axes, errors)  # in the axes of C_i, where C_i + f^2 I is diagonal

    def unlikelihood(bias: float) -> float:
        more = variances + bias**2
        return float((np.log(more) + along**2 / more).sum())

    bounds = (0.0, float(np.abs(along).max()))
    found = scipy.optimize.minimize_scalar(unlikelihood, bounds=bounds, method="bounded", options={"xatol": 1e-7})
    return float(found.x) if found.fun < unlikelihood(0.0) else 0.0


def _fit_photographs(
    field: Field,
    photographs: PosedImages,
    noise: ColorNoise,
    deviations: Float[Tensor, "6"],
    generator: torch.Generator,
) -> Iterator[tuple[Float[Tensor, "6"], Float[Tensor, "6 6"]]]:
    """Yield e_i and C_i of the fits of each photograph, from random poses around its own."""
    camera = reduce_camera(photographs.camera)
    view, depth = View((field,), camera, _ITSELF), _DEPTH * float(field.box.size.max())
    beside = camera.fx * float(deviations[3:].norm() + deviations[:3].norm() / depth)
    every = max(1, -(-len(photographs) // _VIEWS))
    slack = PyramidConfig().misplaced * view.grain / noise.std

    for index in range(0, len(photographs), every):
        true = photographs.poses[index]
        image = resize_picture(photographs.images[index], camera)
        model = _PhotographModel(noise, count_patches(image), slack, _ASTRAY * deviations)
        for draw in deviations * torch.randn(_STARTS, 6, generator=generator):
            start = Pose(so3.retract(true.rotation, draw[3:])[None], (true.position + true.rotation @ draw[:3])[None])
            end, _ = fit_pose(image, view, Guess.at(start), beside, model.prior, AlignConfig(), generator)
            for _ in range(1, _FITS):
                start = Guess.at(end.guess.pose)
                end, _ = fit_pose(image, view, start, beside, model.prior, AlignConfig(), generator)
            found = end.guess.pose[0]
            shift, turn = (found.position - true.position) @ true.rotation, so3.local(true.rotation, found.rotation)
            yield torch.cat([shift, turn]), model.covariance(end, found.rotation)


@dataclass(frozen=True)
class _PhotographModel:
    """Prior and posterior of a filter for one photograph (see gauss_newton/posterior.py)."""

    noise: ColorNoise
    patches: float
    slack: float
    reach: Float[Tensor, "6"]
    """Standard deviation where the photograph says nothing [m, rad]."""

    def prior(self, pixels: int) -> Prior:
        """Return a prior of the exposure alone."""
        return exposure_prior(self.noise, pixels, self.patches, self.slack)

    def covariance(self, end: Iterate, rotation: Float[Tensor, "3 3"]) -> Float[Tensor, "6 6"]:
        """Return C at the end of a fit, in the camera's axes."""
        colors = end.residual[0].numel()
        squares = float(end.cost[0] - end.process[0]) / self.prior(colors // 3).kappa / colors
        axes = torch.block_diag(rotation, torch.eye(3)).double()
        information = axes.T @ picture_information(end).double() @ axes / self.noise.doubt(squares, self.patches)
        return torch.linalg.inv(information + torch.diag(self.reach.double() ** -2))
