"""Levenberg-Marquardt for camera poses, many at once: the core of the fast filter and of global localization.

Unknowns are z = (dp, dtheta, dg, db): position [m] and attitude [rad] of the body, p + dp, R Exp(dtheta), and what
the camera makes of colours, gain 1 + g and bias b. With C the field's colours at a pose and I the picture's,

    r = (1 + g) C + b - I
    J(z) = kappa sum_i w_i 2 huber(r_i) + d' Lambda d + g^2 / s_g^2 + b^2 / s_b^2,     d = pose (-) prior mean

(half the square is minimised by each step, with the curvature of Huber's weights, Holland and Welsch 1977):

    (kappa J'WJ + Lambda_z + lambda D) step = -(kappa J'W r + Lambda_z d_z)

A surface that stands a little beside its place shows most where colours are steep: the variance of r_i is not s^2 but
s^2 + |dC_i/dp|^2 m^2, m how far off surfaces are. So w_i ~ 1 / (1 + |dC_i/dp|^2 m^2 / s^2) at the start, of mean 1.

Every pose is judged on its own: a step that makes it worse is not taken, and
lambda grows, or the next stays plain.

Steps are stretched to where the next ones would lead. Where residuals are large, Gauss and Newton's curvature
leaves out much, and each step is about a rate q times the one before, q up to 0.9. All that follow would be
q / (1 - q) of it (Aitken 1926), so that a step is stretched by

    s = min(1 / (1 - q), 2),   q = 1 - (1 - <step, before> / <before, before>) / s_before

in the metric of the curvature's diagonal, after each step that was taken. In as many steps the filter's median
error in the church was 4 to 8 % less with that, and the 95th percentile 13 to 18 %.

`improve` is one compiled call where the field has a grid that kernels know (kernels/descent.py), else `minimise` in
torch.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core.jit import array_of, threads
from nerfnav.core.structs import TensorStruct
from nerfnav.estimator.photometric.kernels.descent import descend
from nerfnav.estimator.photometric.residuals import THREADS, Observation
from nerfnav.field import RayGrid, get_ray_grid
from nerfnav.geometry import Pose, so3

_SLOWEST = 0.99
"""The most that q is taken for."""
_Steps = Float[Tensor, "n 8"]


def compute_stretches(
    scale: _Steps, step: _Steps, before: _Steps, last: Float[Tensor, " n"], most: float
) -> Float[Tensor, " n"]:
    """Return s of each of n steps, at most `most`.

    `before` are the steps before, stretched by `last` (0: there are none, or they were in vain).
    """
    square = (scale * before.square()).sum(-1)
    share = (scale * step * before).sum(-1) / square.clamp_min(1e-30)
    rate = torch.where((last > 0) & (square > 0), 1 - (1 - share) / last.clamp_min(1e-30), torch.zeros_like(last))
    return (1 / (1 - rate.clamp_max(_SLOWEST))).clamp(1, most)


UNKNOWNS = 8
"""Length of z."""
_EXACTLY = 1e-4
"""Standard deviation that stands for none: half a level of 255 would be 2e-3."""
POSE, EXPOSURE = slice(0, 6), slice(6, 8)
"""Where the parts stand in z."""


@dataclass(frozen=True)
class NewtonConfig:
    """Options of the descent of poses."""

    iterations: int = 7
    """Steps of each pose, at most."""
    damping: float = 1e-2
    """First lambda, relative to the diagonal of the curvature."""
    robust: float = 0.15
    """Colour difference beyond which a pixel pulls less and less (Huber) [1 = full scale]."""
    settled: float = 0.0
    """A step that moves no pose number of any pose further than this [m, rad] is the last, and is taken without looking
    again; 0: no step is."""
    stretch: float = 1.0
    """The most that a step is stretched (see levenberg_marquardt.py); 1: not at all, as suits searches that begin
    far off."""


@dataclass(frozen=True)
class Guess(TensorStruct):
    """Unknowns z of a descent, batch shape (n,)."""

    pose: Pose
    """T_world_body."""
    exposure: Float[Tensor, "*batch 2"]
    """Gain less one, and bias."""

    @classmethod
    def at(cls, poses: Pose) -> "Guess":
        """Return poses (n,) with the exposure that the field was learned with."""
        return cls(poses, torch.zeros(*poses.position.shape[:-1], 2))

    def retract(self, step: Float[Tensor, "*batch 8"]) -> "Guess":
        """Return z (+) step."""
        rotation = so3.retract(self.pose.rotation, step[..., 3:6])
        return Guess(Pose(rotation, self.pose.position + step[..., :3]), self.exposure + step[..., EXPOSURE])


@dataclass(frozen=True)
class Prior:
    """Prior of a descent: knowledge without the picture, in units of standard deviations."""

    information: Float[Tensor, "8 8"]
    """Lambda_z: inverse covariance of z."""
    mean: Pose | None = None
    """Where the body should be; None: nothing is known of it, and its information must be 0."""
    kappa: float = 1.0
    """Weight of one colour's squared difference: 1 / (k s^2), see estimator/photometric/residuals.py."""
    slack: float = 0.0
    """m / s, how far surfaces are misplaced over the noise of colours [m]."""

    def change_of(self, guess: Guess) -> Float[Tensor, "n 8"]:
        """Return d_z: how far guesses (n,) are from what is known."""
        change = torch.cat([torch.zeros(len(guess.exposure), 6), guess.exposure], -1)
        if self.mean is not None:
            turn = so3.local(self.mean.rotation.expand_as(guess.pose.rotation), guess.pose.rotation)
            change[:, POSE] = torch.cat([guess.pose.position - self.mean.position, turn], -1)
        return change

    def arguments(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool, float, float]:
        """Return the arguments of kernels: information, R and p of the mean, whether there is one, kappa and slack."""
        mean = Pose(torch.eye(3), torch.zeros(3)) if self.mean is None else self.mean
        turn, place = array_of(mean.rotation), array_of(mean.position)
        return array_of(self.information), turn, place, self.mean is not None, self.kappa, self.slack


def join_information(pose: Float[Tensor, "6 6"] | None, exposure_std: tuple[float, float]) -> Float[Tensor, "8 8"]:
    """Return Lambda_z from that of a pose (None: 0) and standard deviations of gain and bias (0: known exactly)."""
    information = torch.zeros(UNKNOWNS, UNKNOWNS)
    if pose is not None:
        information[POSE, POSE] = pose
    for index, std in zip((6, 7), exposure_std, strict=True):
        information[index, index] = 1 / max(std, _EXACTLY) ** 2
    return information


@runtime_checkable
class Sight(Protocol):
    """Picture with its prediction."""

    @property
    def colors(self) -> Float[Tensor, "m 3"]:
        """Colours of the picture."""
        ...

    def linearised(self, poses: Pose) -> tuple[Float[Tensor, "n m 3"], Float[Tensor, "n m 3 6"]]:
        """Return the field's colours from poses (n,), and their derivative by position and attitude (in the body)."""
        ...


@dataclass(frozen=True)
class Iterate(TensorStruct):
    """Iterate of a minimisation, batch shape (n,)."""

    guess: Guess
    """z."""
    cost: Float[Tensor, " n"]
    """J there."""
    process: Float[Tensor, " n"]
    """The part of J that the prior makes."""
    residual: Float[Tensor, "n m 3"]
    """r."""
    change: Float[Tensor, "n 8"]
    """d_z, how far z is from the prior's mean."""
    seen: Float[Tensor, "n 8 8"]
    """kappa J'WJ: the picture's part of half of J's second derivative, but for terms with r itself."""
    known: Float[Tensor, "n 8 8"]
    """The prior's part."""
    slope: Float[Tensor, "n 8"]
    """Half of J's derivative."""
    moved: Float[Tensor, " n"]
    """Length of the last step [m or rad, whichever is more]; 0 where it was not taken."""

    @property
    def curvature(self) -> Float[Tensor, "n 8 8"]:
        """Half of J's second derivative."""
        return self.seen + self.known

    def likeliest(self, count: int | None) -> Guess:
        """Return so many of the poses, the cheapest first; None: a third of them."""
        return self.guess[self.cost.argsort()[: count or -(-len(self.cost) // 3)]]


def minimise(sight: Sight, start: Guess, prior: Prior, config: NewtonConfig) -> Iterator[Iterate]:
    """Yield every stage of the descent, the start first; no cost ever rises."""
    here, trust = evaluate(sight, start, prior, config.robust)
    damping, stretch = torch.full_like(here.cost, config.damping), torch.zeros_like(here.cost)
    before = torch.zeros_like(here.slope)
    yield here
    for _ in range(config.iterations):
        scale = here.curvature.diagonal(dim1=-2, dim2=-1).clamp_min(1e-9)
        damped = here.curvature + torch.diag_embed(damping[:, None] * scale)
        plain = -torch.linalg.solve(damped, here.slope)
        stretch = compute_stretches(scale, plain, before, stretch, config.stretch)
        before, step = plain, stretch[:, None] * plain
        moved = step[:, POSE].abs().amax(-1)
        if bool((moved < config.settled).all()):
            guess = here.guess.retract(step)
            change, process, known, _ = _pull(guess, prior)  # what the picture says stays
            yield replace(here, guess=guess, process=process, change=change, known=known, moved=moved)
            return
        tried, _ = evaluate(sight, here.guess.retract(step), prior, config.robust, trust)
        better = tried.cost < here.cost
        here = _chosen(better, tried, here, moved)
        worse = torch.where(stretch > 1, damping, 5 * damping)
        damping = torch.where(better, 0.2 * damping, worse).clamp(1e-7, 1e7)
        stretch = torch.where(better, stretch, torch.zeros_like(stretch))
        yield here
        if bool((moved < config.settled).all()):
            return


def evaluate(
    sight: Sight, guess: Guess, prior: Prior, robust: float, trust: Float[Tensor, "n k"] | None = None
) -> tuple[Iterate, Float[Tensor, "n k"]]:
    """Return J, its slope and its curvature at poses (n,), and w of all colours: `trust` where it is given."""
    shown, by_pose = sight.linearised(guess.pose)
    gain, bias = (guess.exposure[:, None, None, index] for index in (0, 1))
    residual = (1 + gain) * shown + bias - sight.colors
    flat = residual.flatten(1)
    jacobian = torch.cat(
        [(1 + gain)[..., None] * by_pose, shown[..., None], torch.ones_like(shown)[..., None]], -1
    ).flatten(1, 2)
    size = flat.abs()
    if trust is None:
        trust = 1 / (1 + (prior.slack * jacobian[..., :3]).square().sum(-1))
        trust = trust / trust.mean(-1, keepdim=True)
    weighted = jacobian * (prior.kappa * trust * (robust / size.clamp_min(1e-9)).clamp_max(1))[..., None]
    curvature = weighted.transpose(1, 2) @ jacobian
    slope = (flat[:, None] @ weighted)[:, 0]
    loss = (trust * robust_square(size, robust)).sum(-1)
    change, process, known, pulled = _pull(guess, prior)
    cost = prior.kappa * loss + process
    still = torch.zeros_like(cost)
    return Iterate(guess, cost, process, residual, change, curvature, known, slope + pulled, still), trust


def robust_square(size: Float[Tensor, "*batch"], bound: float) -> Float[Tensor, "*batch"]:
    """Squares of differences, growing only linearly beyond a bound (twice Huber's loss)."""
    return torch.where(size <= bound, size.square(), bound * (2 * size - bound))


def _pull(
    guess: Guess, prior: Prior
) -> tuple[Float[Tensor, "n 8"], Float[Tensor, " n"], Float[Tensor, "n 8 8"], Float[Tensor, "n 8"]]:
    """Return d_z, how far guesses are from what is known, and the prior's parts of J, its curvature and its slope."""
    change = prior.change_of(guess)
    derivative = torch.eye(UNKNOWNS).repeat(len(change), 1, 1)
    if prior.mean is not None:
        derivative[:, 3:6, 3:6] = torch.linalg.inv(so3.right_jacobian(change[:, 3:6]))
    push, back = change @ prior.information, derivative.transpose(1, 2)
    pulled = (back @ push[..., None])[..., 0]
    return change, (push * change).sum(-1), back @ prior.information @ derivative, pulled


def _chosen(better: Bool[Tensor, " n"], tried: Iterate, here: Iterate, moved: Float[Tensor, " n"]) -> Iterate:
    """Return the tried stage of the poses that it made better, and the present one of the others."""
    index = torch.arange(len(better)) + len(better) * ~better
    return replace(Iterate.cat([tried, here])[index], moved=torch.where(better, moved, torch.zeros_like(moved)))


def picture_information(here: Iterate, index: int = 0) -> Float[Tensor, "6 6"]:
    """Return a picture's information on one of the poses, with gain and bias marginalised (Schur's complement)."""
    seen, exposure = here.seen[index], here.curvature[index, EXPOSURE, EXPOSURE]
    cross = seen[POSE, EXPOSURE]
    return seen[POSE, POSE] - cross @ torch.linalg.solve(exposure, cross.T)


def improve(
    seen: Observation, start: Guess, prior: Prior, config: NewtonConfig, every: bool = True
) -> Iterator[Iterate]:
    """Yield every stage of the descent, the start first, as `minimise` does; the last one alone, if not `every`.

    The compiled descent ends each pose's where that has settled; it then stands still in later stages. All is done on
    the filter's threads and without gradients; what others do between the stages is not.
    """
    grid = get_ray_grid(seen.field)
    if grid is None:
        stages = minimise(seen, start, prior, config)
        stages = stages if every else _last_of(stages)
    else:
        stages = _compiled(grid, seen, start, prior, config, every)
    while True:
        with torch.no_grad(), threads(THREADS):
            stage = next(stages, None)
        if stage is None:
            return
        yield stage


def _last_of(stages: Iterator[Iterate]) -> Iterator[Iterate]:
    yield deque(stages, maxlen=1).pop()


def _compiled(
    grid: RayGrid, seen: Observation, start: Guess, prior: Prior, config: NewtonConfig, every: bool = True
) -> Iterator[Iterate]:
    count, stages = len(start.exposure), config.iterations + 1
    trace = _trace(stages, count, len(seen.pixels))
    for part, begin in zip(trace, (start.pose.rotation, start.pose.position, start.exposure), strict=False):
        part[0] = begin.numpy()
    held, moved = np.empty((stages, count), np.int64), np.empty((stages, count))
    settings = (config.iterations, config.damping, config.robust, config.settled, config.stretch)
    stages = descend(grid, seen.sight, prior.arguments(), settings, trace, held, moved)
    yielded = slice(0 if every else stages - 1, stages)
    holding = held[yielded], np.arange(count)
    parts = (*(part[holding] for part in trace), moved[yielded])
    shown = [torch.from_numpy(np.asarray(part, np.float32)) for part in parts]
    for rotation, position, exposure, *parts in zip(*shown, strict=True):
        yield Iterate(Guess(Pose(rotation, position), exposure), **dict(zip(_PARTS, parts, strict=True)))


_PARTS = ("cost", "process", "residual", "change", "seen", "known", "slope", "moved")
"""In the order in which the kernel has them."""
assert {"guess", *_PARTS} == {field.name for field in fields(Iterate)}


def _trace(stages: int, poses: int, pixels: int) -> tuple[np.ndarray, ...]:
    """Room for the stages of so many poses: rotation, position, exposure, and `_PARTS` but for the last."""
    square, plain = (UNKNOWNS, UNKNOWNS), ()
    shapes = ((3, 3), (3,), (2,), plain, plain, (pixels, 3), (UNKNOWNS,), square, square, (UNKNOWNS,))
    kinds = [np.float32 if shape == (pixels, 3) else np.float64 for shape in shapes]
    return tuple(np.empty((stages, poses, *shape), kind) for shape, kind in zip(shapes, kinds, strict=True))
