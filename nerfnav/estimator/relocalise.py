"""Where is this camera, if nothing else is known? A search over all free places ("kidnapped robot").

Panoramas from everywhere are rendered once for a field (see estimator/panorama.py). A picture is compared with all of
these at every heading and some tilts, the likeliest poses are improved on small pictures (see estimator/newton.py), the
best few of them on larger ones, and so on; what is left is weighed by its cost J, for a pose is as likely as
exp(-J / 2).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from enum import Enum
from functools import cached_property

import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from nerfnav.compiled import threads
from nerfnav.errors import InvalidInputError
from nerfnav.estimator.newton import Guess, NewtonConfig, Prior, joined, minimise
from nerfnav.estimator.panorama import COLUMN, Panoramas, tilts_of
from nerfnav.estimator.photometric import ColorNoise
from nerfnav.estimator.pyramid import View, reduced, small_observation
from nerfnav.estimator.verdict import check_image
from nerfnav.field.field import Field
from nerfnav.field.levels import levels_of
from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera, Pose
from nerfnav.geometry.grid import node_positions, shape_for

_THREADS = 2
_INDEPENDENT = 20.0
"""How many independent pixels a picture of a trained field is worth: its errors are alike over whole areas."""
_ROOM, _FREE = 0.05, 1.0
"""Room around a camera [m], and density that still counts as free [1/m]."""
_LARGEST = 256
"""Larger pictures are halved until they have no more pixels along their longer edge than twice this."""
_ITSELF = Pose(torch.eye(3), torch.zeros(3))


@dataclass(frozen=True)
class RelocaliseConfig:
    """How the search goes."""

    spacing: float = 0.12
    """Distance of the places that are looked from [m]; wider where there would be too many."""
    most_places: int = 4000
    """Places at most."""
    pitches: tuple[float, ...] = (-0.4, -0.2, 0.0, 0.2, 0.4)
    """Pitches tried at each place and heading [rad]."""
    rolls: tuple[float, ...] = (-0.25, 0.0, 0.25)
    """Rolls tried with each [rad]."""
    halvings: tuple[int, ...] = (3, 2, 1, 0)
    """By which power of 2 the pictures of each stage are reduced."""
    kept: tuple[int, ...] = (192, 48, 10, 3)
    """Poses that each stage improves."""
    iterations: tuple[int, ...] = (8, 8, 8, 12)
    """Steps of each stage, at most."""
    robust: tuple[float, ...] = (0.3, 0.2, 0.15, 0.15)
    """Colour difference beyond which a pixel pulls less and less in each stage (Huber) [1 = full scale]."""
    settled: float = 1e-3
    """A stage ends when no pose number of any pose is moved further than this by a step [m, rad]."""
    pixels: int = 1024
    """Pixels that each stage compares at most."""
    exposure_std: tuple[float, float] = (0.1, 0.05)
    """How far gain and bias of the picture's colours may be from those of the field."""
    alike: tuple[float, float] = (0.1, 0.2)
    """Poses nearer than this are one: position [m], attitude [rad]."""
    gate: float = 3.0
    """LOST where the likeliest pose differs from the picture by more than this many standard deviations."""
    certain: float = 0.9
    """FOUND where the likeliest pose has at least this weight, else AMBIGUOUS."""


class RelocaliseOutcome(Enum):
    """How a search ended; the value is advice for the user."""

    FOUND = "one place looks like the picture"
    AMBIGUOUS = "several places look like the picture: move and look again"
    LOST = "no place looks like the picture: check camera, exposure and field"


@dataclass(frozen=True)
class RelocaliseStep:
    """How far the search is."""

    fraction: float
    """0 to 1."""
    poses: Pose
    """T_world_camera of the likeliest poses so far, best first, batch shape (n,)."""
    weights: Float[Tensor, " n"]
    """How likely each is, summing to 1."""
    differences: Float[Tensor, " n"]
    """How far each is from the picture: robust root mean square of colour, in [0, 1]."""
    outcome: RelocaliseOutcome | None = None
    """None while the search goes on; set on the last step."""

    def body_pose(self, mount: Pose = FORWARD_MOUNT) -> Pose:
        """T_world_body of the likeliest pose, for a camera at `mount` T_body_camera."""
        inverse = mount.rotation.T
        return self.poses[0].compose(Pose(inverse, -inverse @ mount.position))


@dataclass(frozen=True)
class Looks:
    """What a field looks like from everywhere: made once, asked often."""

    view: View
    """The field at all levels, and the camera at the origin of its own frame, with as many pixels as are compared."""
    panoramas: Panoramas
    """The field all around every place."""

    @classmethod
    def of(
        cls, field: Field, camera: Camera, places: Float[Tensor, "n 3"], config: RelocaliseConfig | None = None
    ) -> "Looks":
        """Look from all `places` [m] that are at least `spacing` apart, all around.

        Raises InvalidInputError where there is no place to look from.
        """
        config = RelocaliseConfig() if config is None else config
        if len(places) == 0:
            raise InvalidInputError("there is no free place in the field that a robot could be at")
        halvings = max(0, math.floor(math.log2(max(camera.width, camera.height) / _LARGEST)))
        view = View(levels_of(field, 1 + max(config.halvings)), camera.scaled(0.5**halvings), _ITSELF)
        return cls(view, Panoramas.of(view.levels[-1], thinned(places, config)))

    def likeliest(self, image: UInt8[Tensor, "height width 3"], config: RelocaliseConfig) -> tuple[Pose, Tensor]:
        """The poses T_world_camera from which the field looks most like a picture, best first, and how badly they fit.

        Only headings that fit better than their neighbours on either side count.
        """
        halvings = max(0, math.floor(math.log2(max(1.0, 0.5 * COLUMN * self.view.camera.fx))))
        small = self.view.camera.scaled(0.5**halvings)
        tilts = tilts_of(config.pitches, config.rolls)
        ahead = small.directions(small.pixels()) @ FORWARD_MOUNT.rotation.T
        misfit, tilt = self.panoramas.misfit(reduced(image, small), ahead, tilts).min(1)
        dip = (misfit <= misfit.roll(1, -1)) & (misfit <= misfit.roll(-1, -1))
        dips = torch.where(dip, misfit, torch.inf).flatten()
        value, index = dips.topk(min(config.kept[0], int(dip.sum())), largest=False)
        place, heading = index // misfit.shape[1], index % misfit.shape[1]
        rotation = so3.from_yaw(COLUMN * heading) @ tilts[tilt.flatten()[index]] @ FORWARD_MOUNT.rotation
        return Pose(rotation, self.panoramas.places[place]), value


@dataclass(frozen=True)
class Searcher:
    """Finds a camera anywhere in a field (a `Relocaliser`, see navigation/recovery.py)."""

    field: Field
    """The map."""
    camera: Camera
    """What takes the pictures."""
    noise: ColorNoise
    """How far right colours may be off."""
    config: RelocaliseConfig = dataclass_field(default_factory=RelocaliseConfig)
    """How the search goes."""

    @cached_property
    def looks(self) -> Looks:
        """The field from everywhere, made when it is first asked for: this takes seconds."""
        return Looks.of(self.field, self.camera, free_places(self.field, self.config.spacing), self.config)

    def relocalise(self, image: Tensor) -> Iterator[RelocaliseStep]:
        """Find the pose of the camera that took a picture; see the function of this name."""
        return relocalise(image, self.looks, self.noise, self.config)


@torch.no_grad()
def relocalise(
    image: Tensor, looks: Looks, noise: ColorNoise, config: RelocaliseConfig | None = None
) -> Iterator[RelocaliseStep]:
    """Find the pose of the camera that took `image` (uint8, height x width x 3), from nothing.

    Yields after the first look and after each stage; the last step has the outcome and the few likeliest poses with
    their weights. Raises InvalidInputError for a picture of another size.
    """
    config = RelocaliseConfig() if config is None else config
    check_image(image, looks.view.camera)
    generator = torch.Generator().manual_seed(0)
    poses, misfit = looks.likeliest(image, config)
    cost, differences = misfit / (noise.std**2 / _INDEPENDENT), misfit.clamp_min(0).sqrt()
    for stage, (halvings, kept) in enumerate(zip(config.halvings, config.kept, strict=True)):
        best = cost.argsort()[:kept]
        yield _step(stage / len(config.halvings), poses[best], cost[best], differences[best])
        seen = small_observation(image, looks.view.at(halvings), config.pixels, generator)
        kappa = 1 / ((1 + len(seen.pixels) / _INDEPENDENT) * noise.std**2)
        settings = NewtonConfig(config.iterations[stage], robust=config.robust[stage], settled=config.settled)
        with threads(_THREADS):
            *_, last = minimise(
                seen, Guess.at(poses[best]), Prior(joined(None, config.exposure_std), None, kappa), settings
            )
        differences = robust_square(last.residual.abs(), settings.robust).mean((1, 2)).sqrt()
        chosen = distinct(last.guess.pose, last.cost, config.alike)
        poses, cost, differences = last.guess.pose[chosen], last.cost[chosen], differences[chosen]
    ended = _step(1.0, poses, cost, differences)
    yield replace(ended, outcome=_outcome(ended, noise, config))


def robust_square(size: Float[Tensor, "*batch"], bound: float) -> Float[Tensor, "*batch"]:
    """Squares of differences, growing only linearly beyond a bound (twice Huber's loss)."""
    return torch.where(size <= bound, size.square(), bound * (2 * size - bound))


def free_places(field: Field, spacing: float) -> Float[Tensor, "n 3"]:
    """Points in the box that a camera could be at, on a grid [m]: no density there, nor `_ROOM` around."""
    inner = Box(field.box.lower + _ROOM, field.box.upper - _ROOM)
    points = node_positions(inner, shape_for(inner, spacing)).reshape(-1, 3)
    around = torch.cat([torch.zeros(1, 3), _ROOM * torch.eye(3), -_ROOM * torch.eye(3)])
    with torch.no_grad():
        density = field.density(points[:, None] + around).amax(-1)
    return points[density < _FREE]


def thinned(places: Float[Tensor, "n 3"], config: RelocaliseConfig) -> Float[Tensor, "m 3"]:
    """One of the places in each cell of a grid, whose cells grow until there are few enough."""
    spacing = config.spacing
    while True:
        cells = torch.unique((places / spacing).round().long(), dim=0, return_inverse=True)[1]
        count = int(cells.max()) + 1
        if count <= config.most_places:
            break
        spacing *= 1.15
    first = torch.full((count,), len(places)).scatter_reduce(0, cells, torch.arange(len(places)), "amin")
    return places[first]


def distinct(poses: Pose, cost: Float[Tensor, " n"], alike: tuple[float, float]) -> Int[Tensor, " m"]:
    """Which is the cheapest pose of each group of poses that are alike, cheapest first."""
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


def _step(fraction: float, poses: Pose, cost: Float[Tensor, " n"], differences: Float[Tensor, " n"]) -> RelocaliseStep:
    return RelocaliseStep(fraction, poses, torch.softmax(-0.5 * cost, 0), differences)


def _outcome(step: RelocaliseStep, noise: ColorNoise, config: RelocaliseConfig) -> RelocaliseOutcome:
    if not step.differences[0] <= config.gate * noise.std:
        return RelocaliseOutcome.LOST
    return RelocaliseOutcome.FOUND if step.weights[0] >= config.certain else RelocaliseOutcome.AMBIGUOUS
