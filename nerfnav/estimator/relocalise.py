"""Where is this camera, if nothing else is known? A search over all free places ("kidnapped robot").

A coarse look from everywhere is rendered once for a field and a camera. A picture is compared with all of these, the
likeliest are aligned on small pictures, the better half of them on larger ones, and so on; what is left is weighed.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.estimator.alignment import AlignConfig, SmallPicture, align, robust_cost
from nerfnav.estimator.photometric import ColorNoise
from nerfnav.field.field import Field
from nerfnav.geometry import so3
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera, Pose


@dataclass(frozen=True)
class RelocaliseConfig:
    """How the search goes."""

    spacing: float = 0.17
    """Distance of the places that are looked from [m]; wider where there would be too many."""
    most_places: int = 4000
    """Places at most."""
    headings: int = 12
    """Headings tried at each place, level."""
    sides: tuple[int, ...] = (16, 28, 56)
    """Longer side of the small pictures of each stage [pixels]."""
    kept: tuple[int, ...] = (40, 8, 3)
    """Poses that each stage aligns."""
    align: AlignConfig = AlignConfig()
    """How poses are aligned."""
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

    field: Field
    """Where."""
    camera: Camera
    """What looks."""
    poses: Pose
    """T_world_camera, batch shape (n,)."""
    pictures: Float[Tensor, "n p 3"]
    """The small picture of each pose."""

    @classmethod
    def of(
        cls, field: Field, camera: Camera, places: Float[Tensor, "n 3"], config: RelocaliseConfig | None = None
    ) -> "Looks":
        """Look from all `places` [m] that are at least `spacing` apart, level, all around.

        Raises InvalidInputError where there is no place to look from.
        """
        config = RelocaliseConfig() if config is None else config
        if len(places) == 0:
            raise InvalidInputError("there is no free place in the field that a robot could be at")
        chosen = thinned(places, config)
        yaw = torch.arange(config.headings) * (2 * math.pi / config.headings)
        level = so3.from_yaw(yaw) @ FORWARD_MOUNT.rotation
        count = len(chosen)
        rotation = level.expand(count, -1, 3, 3).reshape(-1, 3, 3)
        poses = Pose(rotation, chosen.repeat_interleave(config.headings, 0))
        blank = torch.zeros(camera.height, camera.width, 3, dtype=torch.uint8)
        picture = SmallPicture.of(blank, field, camera, config.sides[0])
        parts = [picture.rendered(poses[start : start + 256]) for start in range(0, len(poses.position), 256)]
        return cls(field, camera, poses, torch.cat(parts))


def relocalise(
    image: Tensor, looks: Looks, noise: ColorNoise, config: RelocaliseConfig | None = None
) -> Iterator[RelocaliseStep]:
    """Find the pose of the camera that took `image` (uint8, height x width x 3), from nothing.

    Yields after the first look and after each stage; the last step has the outcome and the few likeliest poses with
    their weights. Raises InvalidInputError for a picture of another size.
    """
    config = RelocaliseConfig() if config is None else config
    camera = looks.camera
    if image.dtype != torch.uint8 or tuple(image.shape) != (camera.height, camera.width, 3):
        raise InvalidInputError(
            f"this camera takes uint8 pictures of {camera.height} x {camera.width} x 3, not "
            f"{str(image.dtype).removeprefix('torch.')} of {' x '.join(map(str, image.shape))}"
        )
    seen = SmallPicture.of(image, looks.field, camera, config.sides[0])
    cost = robust_cost((looks.pictures - seen.colors).flatten(1), config.align.robust)
    poses = looks.poses
    for stage, (side, kept) in enumerate(zip(config.sides, config.kept, strict=True)):
        best = cost.argsort()[:kept]
        yield _step((stage + 1) / (len(config.sides) + 2), poses[best], cost[best], noise)
        picture = SmallPicture.of(image, looks.field, camera, side)
        poses, cost = align(picture, poses[best], config.align)
        poses, cost = distinct(poses, cost, config.alike)
    last = _step(1.0, poses, cost, noise)
    yield RelocaliseStep(1.0, last.poses, last.weights, last.differences, _outcome(last, noise, config))


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


def distinct(
    poses: Pose, cost: Float[Tensor, " n"], alike: tuple[float, float]
) -> tuple[Pose, Float[Tensor, " m"]]:
    """The cheapest pose of each group of poses that are alike, cheapest first."""
    order = cost.argsort()
    poses, cost = poses[order], cost[order]
    chosen: list[int] = []
    for index in range(len(cost)):
        others = poses[torch.tensor(chosen, dtype=torch.long)]
        far = (others.position - poses.position[index]).norm(dim=-1) > alike[0]
        turned = so3.local(others.rotation, poses.rotation[index].expand_as(others.rotation)).norm(dim=-1) > alike[1]
        if bool((far | turned).all()):
            chosen.append(index)
    kept = torch.tensor(chosen)
    return poses[kept], cost[kept]


def _step(fraction: float, poses: Pose, cost: Float[Tensor, " n"], noise: ColorNoise) -> RelocaliseStep:
    # the mean over the channels stands for as many independent pixels as a filter's picture has
    evidence = -cost / noise.std**2 * _INDEPENDENT
    return RelocaliseStep(fraction, poses, torch.softmax(evidence, 0), (2 * cost).sqrt())


def _outcome(step: RelocaliseStep, noise: ColorNoise, config: RelocaliseConfig) -> RelocaliseOutcome:
    if not step.differences[0] <= config.gate * noise.std:
        return RelocaliseOutcome.LOST
    return RelocaliseOutcome.FOUND if step.weights[0] >= config.certain else RelocaliseOutcome.AMBIGUOUS


_INDEPENDENT = 20.0
"""How many independent colours a picture of a trained field is worth: its errors are alike over whole areas."""
