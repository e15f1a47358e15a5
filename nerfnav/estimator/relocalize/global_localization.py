"""Global localization: find a camera in the whole free space of a field from one picture ("kidnapped robot").

Panoramas from everywhere are rendered once for a field (panorama.py). A picture is compared with all of these at
every heading and some tilts, the likeliest poses are improved on small pictures (levenberg_marquardt.py), the best
few of them on larger ones, and so on; the rest is weighed by its cost J, for a pose is as likely as exp(-J / 2). The
places may be everywhere or a few likely ones (localizer.py).
"""

from collections.abc import Generator
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from enum import Enum

import torch
from jaxtyping import Float, Int
from torch import Tensor

from nerfnav.core.structs import TensorStruct
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
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.estimator.relocalize.panorama import PanoramaConfig, PanoramaIndex
from nerfnav.field import FieldInfo
from nerfnav.geometry import FORWARD_MOUNT, Pose, so3

_NOTHING = 1e-4
"""Information that stands for none [1/m^2, 1/rad^2]: a standard deviation of 100."""
_USUAL = 2.6
"""Longest edge of a place [m]: Stonehenge's."""
_NOISY = 0.037
"""Standard deviation of colours at which `vague` was chosen: Stonehenge's."""
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
    exposure_std: tuple[float, float] = (0.1, 0.05)
    """How far gain and bias of the picture's colours may be from those of the field."""
    alike: tuple[float, float] = (0.04, 0.2)
    """Poses nearer than this are one: position [longest edges of the box], attitude [rad]."""
    gate: float = 1.5
    """LOST where the likeliest pose differs from the picture by more than this many standard deviations."""
    certain: float = 0.9
    """FOUND where the likeliest pose has at least this weight, else AMBIGUOUS."""
    vague: tuple[float, float] = (0.006, 0.015)
    """AMBIGUOUS also where the picture leaves the likeliest pose a larger standard deviation than this in some
    direction: position [longest edges of the box], attitude [rad]; more where colours are noisier than `_NOISY`, up to
    half of `alike`. What little shows in a picture of the sky looks alike from many places, more than are compared,
    which is no matter of how noisy colours are. Of 32 pictures of Stonehenge (2.6 m), none that was found rightly left
    more than 0.007 m and 0.010; one of the sky that was found 0.8 m away from where it was taken left 0.008 m and
    0.019."""
    views: tuple[float, ...] = ()
    """Poses of the photographs that the field learned from (`FieldInfo.views`); empty where they are unknown."""

    def for_field(self, info: FieldInfo) -> "RelocaliseConfig":
        """Return the options with the poses of a field's capture."""
        return replace(self, views=info.views)

    def in_place(self, size: float) -> "RelocaliseConfig":
        """Return the options with lengths in metres, for a place whose longest edge is `size` [m]."""
        alike, vague = ((size * share, angle) for share, angle in (self.alike, self.vague))
        return replace(self, alike=alike, vague=vague, settled=min(1.0, size / _USUAL) * self.settled)

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
    while best is None or (best.outcome is RelocaliseOutcome.LOST and len(first.cost)):
        mine, first = first[: config.kept[0]], first[config.kept[0] :]
        ranking, deviations = yield from _improve(mine, image, panoramas, noise, config, share, done)
        if best is None or ranking.differences[0] < best.step.differences[0]:
            step = ranking.step(1.0)
            best = RelocaliseResult(_judge(step, deviations, noise, config), step)
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
) -> Generator[RelocaliseStep, None, tuple[_Ranking, Float[Tensor, "2"]]]:
    """Improve poses through all stages; `done` is the share of the whole search that was done before.

    Returns them, and the largest standard deviations of the best.
    """
    generator, deviations = torch.Generator().manual_seed(0), torch.full((2,), torch.inf)
    exposure = join_information(None, config.exposure_std)
    stages = zip(config.halvings, config.kept, config.iterations, config.robust, strict=True)
    for stage, (halvings, kept, iterations, robust) in enumerate(stages):
        ranking = ranking[ranking.cost.argsort()[:kept]]
        yield ranking.step(share * (done + stage / (len(config.halvings) * config.attempts)))
        last_one = stage + 1 == len(config.halvings)
        pixels = config.last_pixels if last_one and config.last_pixels is not None else config.pixels
        seen = observe_reduced(image, panoramas.view.at(halvings), pixels, generator)
        kappa = 1 / ((1 + len(seen.pixels) / _INDEPENDENT) * noise.std**2)
        settings = NewtonConfig(iterations, robust=robust, settled=config.settled)
        *_, here = improve(seen, Guess.at(ranking.poses), Prior(exposure, None, kappa), settings, every=False)
        differences = robust_square(here.residual.abs(), robust).mean((1, 2)).sqrt()
        deviations = _largest_deviations(here) if last_one else deviations
        ranking = _Ranking(here.guess.pose, here.cost, differences)
        ranking = ranking[select_distinct(here.guess.pose, here.cost, config.alike)]
    return ranking, deviations


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


def _largest_deviations(here: Iterate) -> Float[Tensor, "2"]:
    """Return the largest standard deviations of the likeliest pose after a picture: position [m], attitude [rad]."""
    known = picture_information(here, int(here.cost.argsort()[0])).double()
    covariance = torch.linalg.inv(known + _NOTHING * torch.eye(6).double())
    parts = [torch.linalg.eigvalsh(covariance[part, part])[-1].sqrt() for part in (slice(0, 3), slice(3, 6))]
    return torch.stack(parts).float()


def _judge(
    step: RelocaliseStep, deviations: Float[Tensor, "2"], noise: ColorNoise, config: RelocaliseConfig
) -> RelocaliseOutcome:
    """Return the outcome by the fit, the weight and the standard deviations of the likeliest pose."""
    if not step.differences[0] <= config.gate * noise.std:
        return RelocaliseOutcome.LOST
    noisier = max(1.0, noise.std / _NOISY)
    vague = torch.minimum(noisier * torch.tensor(config.vague), 0.5 * torch.tensor(config.alike))
    sharp = bool((deviations <= vague).all())
    return RelocaliseOutcome.FOUND if sharp and step.weights[0] >= config.certain else RelocaliseOutcome.AMBIGUOUS
