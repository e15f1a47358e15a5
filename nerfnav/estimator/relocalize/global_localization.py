"""Global localization: find a camera in the whole free space of a field from one picture ("kidnapped robot").

Panoramas from everywhere are rendered once for a field (panorama.py). A picture is compared with all of these at
every heading and some tilts, the likeliest poses are improved on small pictures (levenberg_marquardt.py), the best
few of them on larger ones, and so on; the rest is weighed by its cost J, for a pose is as likely as exp(-J / 2). The
places may be everywhere or a few likely ones (localizer.py).

In the end, poses around the best are improved too, on other pixels. They show whether its descent stalled, and which
minima a rough cost has there. The covariance is that of the mixture of all ends near the best (Bar-Shalom, Li,
Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 1.4.16),

    Sigma = P + sum_i w_i d_i d_i',   w_i ~ exp(-J_i / 2)

with P from secants (photometric/secant.py), d_i from the best, and J's noise no less than the best's own. A place is
FOUND only where it differs from the picture no more than the field differs from held-out views, and all other places
differ much more: the best of many false places has no such margin.
"""

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from enum import Enum

import torch
from jaxtyping import Float, Int
from torch import Tensor

from nerfnav.core.structs import TensorStruct
from nerfnav.estimator.core.belief import POSE
from nerfnav.estimator.photometric.levenberg_marquardt import (
    Guess,
    Iterate,
    NewtonConfig,
    Prior,
    improve,
    join_information,
    picture_information,
    robust_square,
)
from nerfnav.estimator.photometric.pyramid import observe_reduced
from nerfnav.estimator.photometric.residuals import ColorNoise, Observation, count_patches
from nerfnav.estimator.photometric.secant import invert, settle_information
from nerfnav.estimator.relocalize.panorama import PanoramaConfig, PanoramaIndex
from nerfnav.field import FieldInfo
from nerfnav.geometry import FORWARD_MOUNT, Pose, so3
from nerfnav.robots import TANGENT

_USUAL = 2.6
"""Longest edge of a place [m]: Stonehenge's."""
_NOISY = 0.037
"""Standard deviation of colours at which `vague` was chosen: Stonehenge's."""
_ROUNDS = 6
"""Rounds until the covariance settles: two are too few."""
_PARTS = (slice(0, 3), slice(3, 6))
"""Position and attitude in a pose's tangent."""
_LEAST_KEPT = 3
_FEWER, _FINER = 6, 2
"""So many times fewer poses are improved among those that are near to the capture's; at so many times fewer pixels
first, and more in the end."""
_SURE = 1.25
"""`gate` of those: what fits worse may fit better elsewhere."""
_INDEPENDENT = 20.0
"""How many independent pixels a picture of a trained field is worth: its errors are alike over whole areas."""


@dataclass(frozen=True)
class RelocaliseConfig:
    """Options of the search."""

    looks: PanoramaConfig = dataclass_field(default_factory=PanoramaConfig)
    """Places of the panoramas."""
    halvings: tuple[int, ...] = (3, 2, 1, 0)
    """By which power of 2 the pictures of each stage are reduced."""
    kept: tuple[int, ...] = (160, 24, 6, 3)
    """Poses that each stage improves."""
    iterations: tuple[int, ...] = (6, 6, 8, 12)
    """Steps of each stage, at most."""
    robust: tuple[float, ...] = (0.3, 0.2, 0.15, 0.15)
    """Colour difference beyond which a pixel pulls less and less in each stage (Huber) [1 = full scale]."""
    settled: float = 1e-3
    """A stage ends when no pose number of any pose is moved further than this by a step [m, rad]; sooner by as much as
    a place is smaller than `_USUAL`."""
    attempts: int = 3
    """Times that the next likeliest `kept[0]` poses are improved while no place looks like the picture."""
    pixels: int = 1024
    """Pixels that each stage compares at most."""
    last_pixels: int | None = None
    """The same of the last stage; None: as many."""
    settling_pixels: int = 3000
    """The same of the ends of all attempts: over 1,024, a rough cost ends in a plain room twice as far off."""
    exposure_std: tuple[float, float] = (0.1, 0.05)
    """How far gain and bias of the picture's colours may be from those of the field."""
    alike: tuple[float, float] = (0.04, 0.2)
    """Poses nearer than this are one: position [longest edges of the box], attitude [rad]."""
    gate: float = 1.5
    """LOST where the likeliest pose differs from the picture by more than this many standard deviations ..."""
    core_gate: float = 6.5
    """... or this many of `core_std`: in a plain place, outliers of a few views make most of the noise, and false
    places differ less than that."""
    certain: float = 0.9
    """FOUND where the likeliest pose has at least this weight, else AMBIGUOUS ..."""
    margin: float = 1.8
    """... and where each other place differs from the picture this many times as much, at least. Right places in
    bundled worlds have margins of 1.9 and more, false ones in plain rooms 1.2 to 1.5."""
    around: tuple[float, float] = (0.012, 0.04)
    """Standard deviation of the poses around the best that are improved, too: position [longest edges of the box],
    attitude [rad]."""
    restarts: int = 15
    """Number of these."""
    core_std: float | None = None
    """Standard deviation of the field's colours on held-out views without outliers (`FieldInfo.noise_core_std`); None
    where it is unknown."""
    vague: tuple[float, float] = (0.015, 0.03)
    """AMBIGUOUS also where the covariance of the likeliest pose has a larger standard deviation than this in some
    direction: position [longest edges of the box], attitude [rad]; more where colours are noisier than `_NOISY`, up to
    half of `alike`. What little shows in a picture of the sky looks alike from many places, more than are compared."""
    views: tuple[float, ...] = ()
    """Poses of the photographs that the field learned from (`FieldInfo.views`); empty where they are unknown."""

    def for_field(self, info: FieldInfo) -> "RelocaliseConfig":
        """Return the options with the poses of a field's capture, and with its noise without outliers."""
        return replace(self, views=info.views, core_std=info.noise_core_std)

    def in_place(self, size: float) -> "RelocaliseConfig":
        """Return the options with lengths in metres, for a place whose longest edge is `size` [m]."""
        alike, vague, around = ((size * share, angle) for share, angle in (self.alike, self.vague, self.around))
        settled = min(1.0, size / _USUAL) * self.settled
        return replace(self, alike=alike, vague=vague, around=around, settled=settled)

    def near(self) -> "RelocaliseConfig":
        """Return the options for poses near to the capture's, which are few."""
        kept = tuple(min(most, max(_LEAST_KEPT, most // _FEWER)) for most in self.kept)
        return replace(
            self,
            kept=kept,
            attempts=1,
            pixels=self.pixels // _FINER,
            last_pixels=self.pixels * _FINER,
            gate=min(self.gate, _SURE),
        )


class RelocaliseOutcome(Enum):
    """Outcome of a search; the value is advice for the user."""

    FOUND = "one place looks like the picture"
    AMBIGUOUS = "several places look like the picture: move and look again"
    LOST = "no place looks like the picture: check camera, exposure and field"


@dataclass(frozen=True)
class RelocaliseStep:
    """Progress of a search."""

    fraction: float
    """Share of the search that is done, 0 to 1."""
    poses: Pose
    """T_world_camera of the likeliest poses so far, best first, batch shape (n,)."""
    weights: Float[Tensor, " n"]
    """How likely each is, summing to 1."""
    differences: Float[Tensor, " n"]
    """Difference of each from the picture: robust root mean square of colour, in [0, 1]."""

    def body_poses(self, mount: Pose = FORWARD_MOUNT) -> Pose:
        """Return T_world_body of all poses, for a camera at `mount` T_body_camera."""
        inverse = mount.rotation.T
        return self.poses.compose(Pose(inverse, -inverse @ mount.position))


@dataclass(frozen=True)
class RelocaliseResult:
    """Result of a search."""

    outcome: RelocaliseOutcome
    """Number of places that look like the picture."""
    step: RelocaliseStep
    """Last step: the likeliest poses with their weights."""
    covariance: Float[Tensor, "6 6"]
    """Covariance of the likeliest T_world_camera: position [m] in the world's axes, attitude [rad] in the camera's
    tangent, R Exp(dtheta)."""

    def state_covariance(self, mount: Pose = FORWARD_MOUNT) -> Float[Tensor, "12 12"]:
        """Return the covariance in the tangent of the state whose pose is `step.body_poses(mount)[0]`; no rates."""
        body = self.step.body_poses(mount)[0]
        change = torch.eye(6)
        change[:3, 3:] = body.rotation @ so3.hat(mount.position) @ mount.rotation
        change[3:, 3:] = mount.rotation
        covariance, pose = torch.zeros(TANGENT, TANGENT), torch.tensor(POSE)
        covariance[pose[:, None], pose] = change @ self.covariance @ change.T
        return covariance


Relocalisation = Generator[RelocaliseStep, None, RelocaliseResult]
"""Search in progress: yields the likeliest poses so far, returns the result."""


def relocalise(
    image: Tensor, panoramas: PanoramaIndex, noise: ColorNoise, config: RelocaliseConfig | None = None
) -> Relocalisation:
    """Find the pose of the camera that took `image` (uint8, height x width x 3), without a prediction.

    Yields after the first comparison and after each stage, and the result's step in the end. Raises InvalidInputError
    for a picture of another size.
    """
    found = yield from search_panoramas(image, panoramas, noise, RelocaliseConfig() if config is None else config)
    yield found.step
    return found


@torch.no_grad()
def search_panoramas(
    image: Tensor, panoramas: PanoramaIndex, noise: ColorNoise, config: RelocaliseConfig, share: float = 1.0
) -> Relocalisation:
    """Search as `relocalise` does, as a `share` of a longer search; the result's step is not yielded."""
    config = config.in_place(float(panoramas.view.levels[0].box.size.max()))
    image = panoramas.fitted(image)
    unit = noise.std**2 / _INDEPENDENT
    gain, bias = (unit / std**2 for std in config.exposure_std)
    poses, misfit = panoramas.likeliest(image, config.attempts * config.kept[0], (gain, bias))
    first = _Ranking(poses, misfit / unit, misfit.clamp_min(0).sqrt())
    best, done = None, 0.0
    while best is None or (best.outcome is not RelocaliseOutcome.FOUND and len(first.cost)):
        mine, first = first[: config.kept[0]], first[config.kept[0] :]
        ranking = yield from _improve(mine, image, panoramas, noise, config, share, done)
        poses = ranking.poses if best is None else Pose.cat([best.step.poses, ranking.poses])
        best = _settle(poses, image, panoramas, noise, config)
        done += 1 / config.attempts
    return best


@dataclass(frozen=True)
class _Ranking(TensorStruct):
    """Poses, batch shape (n,)."""

    poses: Pose
    cost: Float[Tensor, "*batch"]
    differences: Float[Tensor, "*batch"]

    def step(self, fraction: float) -> RelocaliseStep:
        return RelocaliseStep(fraction, self.poses, torch.softmax(-0.5 * self.cost, 0), self.differences)


def _improve(
    ranking: _Ranking,
    image: Tensor,
    panoramas: PanoramaIndex,
    noise: ColorNoise,
    config: RelocaliseConfig,
    share: float,
    done: float,
) -> Generator[RelocaliseStep, None, _Ranking]:
    """Improve poses through all stages; `done` is the share of the whole search that was done before."""
    generator = torch.Generator().manual_seed(0)
    stages = zip(config.halvings, config.kept, config.iterations, config.robust, strict=True)
    for stage, (halvings, kept, iterations, robust) in enumerate(stages):
        ranking = ranking[ranking.cost.argsort()[:kept]]
        yield ranking.step(share * (done + stage / (len(config.halvings) * config.attempts)))
        last_one = stage + 1 == len(config.halvings)
        pixels = config.last_pixels if last_one and config.last_pixels is not None else config.pixels
        seen = observe_reduced(image, panoramas.view.at(halvings), pixels, generator)
        ranking, _ = _descend(seen, ranking.poses, iterations, robust, noise, config)
        ranking = ranking[select_distinct(ranking.poses, ranking.cost, config.alike)]
    return ranking


def _descend(
    seen: Observation, poses: Pose, iterations: int, robust: float, noise: ColorNoise, config: RelocaliseConfig
) -> tuple[_Ranking, Iterate]:
    """Improve poses on the same pixels; return them also with their curvatures."""
    kappa = 1 / ((1 + len(seen.pixels) / _INDEPENDENT) * noise.std**2)
    settings = NewtonConfig(iterations, robust=robust, settled=config.settled)
    prior = Prior(join_information(None, config.exposure_std), None, kappa)
    *_, here = improve(seen, Guess.at(poses), prior, settings, every=False)
    differences = robust_square(here.residual.abs(), robust).mean((1, 2)).sqrt()
    return _Ranking(here.guess.pose, here.cost, differences), here


def _settle(
    poses: Pose, image: Tensor, panoramas: PanoramaIndex, noise: ColorNoise, config: RelocaliseConfig
) -> RelocaliseResult:
    """Improve the ends of all attempts, and poses around the best, on the same pixels; judge the result."""
    generator = torch.Generator().manual_seed(1)
    seen = observe_reduced(image, panoramas.view.at(0), config.settling_pixels, generator)
    ends, here = _descend(seen, poses, config.iterations[-1], config.robust[-1], noise, config)
    best = ends.poses[int(ends.cost.argmin())]
    scale = torch.linspace(0, 1, config.restarts + 1)[1:, None]
    shift, turn = (std * scale * torch.randn(len(scale), 3, generator=generator) for std in config.around)
    around = Pose(so3.retract(best.rotation.expand(len(scale), 3, 3), turn), best.position + shift)
    more, there = _descend(seen, around, config.iterations[-1], config.robust[-1], noise, config)
    ends, here = _Ranking.cat([ends, more]), Iterate.cat([here, there])
    step = ends[select_distinct(ends.poses, ends.cost, config.alike)].step(1.0)
    patches = count_patches(image, noise_std=noise.usual_std(seen.field))
    covariance = _mixture_covariance(ends, here, seen, noise, patches, config)
    return RelocaliseResult(judge(step, covariance, noise, config), step, covariance)


def _mixture_covariance(
    ends: _Ranking, here: Iterate, seen: Observation, noise: ColorNoise, patches: float, config: RelocaliseConfig
) -> Float[Tensor, "6 6"]:
    """Return Sigma of the best end, in its tangent, for a picture of so many patches."""
    index = int(ends.cost.argmin())
    best, doubt = ends.poses[index], max(1.0, float(ends.differences[index]) / noise.std) ** 2
    turns = so3.local(best.rotation.expand_as(ends.poses.rotation), ends.poses.rotation)
    away = torch.cat([ends.poses.position - best.position, turns], 1)
    near = (away[:, :3].norm(dim=1) <= config.alike[0]) & (away[:, 3:].norm(dim=1) <= config.alike[1])
    weights = torch.softmax(torch.where(near, -0.5 * ends.cost / doubt, -torch.inf), 0)
    prior = join_information(torch.diag(torch.tensor(config.alike).repeat_interleave(3) ** -2.0), config.exposure_std)
    start = torch.linalg.inv(picture_information(here, index) / doubt + prior[:6, :6])
    alike = doubt * noise.alike_of(len(seen.pixels), patches) * max(1.0, noise.few_patches / patches)
    guess = here.guess[index : index + 1]
    found = settle_information(seen, guess, start, prior, noise.std, alike, config.robust[-1], _ROUNDS)
    return invert(found + prior[:6, :6].double()).float() + (weights * away.T) @ away


def select_distinct(poses: Pose, cost: Float[Tensor, " n"], alike: tuple[float, float]) -> Int[Tensor, " m"]:
    """Return the indices of the cheapest pose of each group of alike poses, cheapest first."""
    order = cost.argsort()
    poses = poses[order]
    chosen: list[int] = []
    for index in range(len(order)):
        others = poses[torch.tensor(chosen, dtype=torch.long)]
        far = (others.position - poses.position[index]).norm(dim=-1) > alike[0]
        turned = so3.local(others.rotation, poses.rotation[index].expand_as(others.rotation)).norm(dim=-1) > alike[1]
        if bool((far | turned).all()):
            chosen.append(index)
    return order[torch.tensor(chosen)]


def judge(
    step: RelocaliseStep, covariance: Float[Tensor, "6 6"], noise: ColorNoise, config: RelocaliseConfig
) -> RelocaliseOutcome:
    """Return the outcome by the fit, the margin and the standard deviations of the likeliest pose."""
    core = config.core_gate * config.core_std if config.core_std else math.inf
    if not step.differences[0] <= min(config.gate * noise.std, core):
        return RelocaliseOutcome.LOST
    deviations = torch.stack([torch.linalg.eigvalsh(covariance[part, part])[-1].sqrt() for part in _PARTS])
    noisier = max(1.0, noise.std / _NOISY)
    vague = torch.minimum(noisier * torch.tensor(config.vague), 0.5 * torch.tensor(config.alike))
    sharp = bool((deviations <= vague).all())
    alone = bool((step.differences[1:] >= config.margin * step.differences[0]).all())
    unique = alone and bool(step.weights[0] >= config.certain)
    return RelocaliseOutcome.FOUND if sharp and unique else RelocaliseOutcome.AMBIGUOUS
