"""A tiny place to estimate in: soft balls all around, a small wide camera, a quadrotor that hovers."""

from collections.abc import Generator
from functools import cache
from typing import NamedTuple, TypeVar

import torch
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_step import Estimator, FilterResult, FilterStep
from nerfnav.estimator.core.prediction import predict
from nerfnav.estimator.paper.cost import PoseCost
from nerfnav.estimator.photometric.residuals import ColorNoise, FieldCamera, Observation
from nerfnav.field.core.protocol import Field
from nerfnav.field.models.analytic import BallsField
from nerfnav.field.models.levels import raw_of
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera
from nerfnav.geometry.grid import node_positions, shape_for
from nerfnav.robots import StateNoise
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.state import RigidState

ROBOT = Quadrotor()
HOVER = torch.tensor([ROBOT.weight, 0.0, 0.0, 0.0])
CAMERA = Camera.from_fov(24, 20, 90)
BOX = Box.of((-1.0, -1.0, -0.2), (1.0, 1.0, 0.8))
HERE = RigidState.at_rest((-0.3, 0.0, 0.25))
COLOR_STD = 0.02
Step = TypeVar("Step")
Result = TypeVar("Result")
DT = 0.1


def balls() -> BallsField:
    """Balls near and far, left and right, high and low, so that every pose number shows."""
    centers = torch.tensor([
        [0.1, 0.25, 0.35], [0.5, -0.1, 0.2], [0.2, -0.35, 0.1], [0.0, 0.1, -0.05],
        [0.7, 0.4, 0.4], [0.05, -0.2, 0.55], [0.8, -0.6, 0.3],
    ])  # fmt: skip
    radii = torch.tensor([0.12, 0.15, 0.12, 0.12, 0.3, 0.1, 0.25])
    return BallsField(BOX, centers, radii, softness=0.02, step=0.03)


def draws(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def picture(field: Field, state: RigidState, noise: torch.Generator | None = None) -> Tensor:
    """What the robot's camera sees of the field, with noise of COLOR_STD where there is a generator."""
    color = render_image(field, CAMERA, state.pose.compose(FORWARD_MOUNT)).color
    if noise is not None:
        color = color + COLOR_STD * torch.randn(color.shape, generator=noise)
    return (255 * color.clamp(0, 1)).round().to(torch.uint8)


def cost_at(truth: RigidState, prediction: Belief, colors: ColorNoise | None = None) -> PoseCost:
    """J for the picture taken at `truth`, over all pixels."""
    field = balls()
    observation = Observation.of(picture(field, truth), CAMERA.pixels(), FieldCamera(field, CAMERA, FORWARD_MOUNT))
    return PoseCost.of(observation, prediction, ColorNoise(std=COLOR_STD, alike=1.0) if colors is None else colors)


def near(state: RigidState, seed: int, noise: StateNoise | None = None) -> Belief:
    """A belief whose mean is off as its covariance says."""
    noise = StateNoise(0.01, 0.01, 0.01, 0.01) if noise is None else noise
    return Belief(state.retract(noise.sample(draws(seed))), noise.covariance())


def collect(generator: Generator[Step, None, Result]) -> tuple[list[Step], Result]:
    """Run a generator; returns its steps and its result."""
    steps: list[Step] = []
    while True:
        try:
            steps.append(next(generator))
        except StopIteration as end:
            return steps, end.value


class Updated(NamedTuple):
    """One update of a simulated robot."""

    steps: list[FilterStep]
    result: FilterResult
    truth: RigidState
    prediction: Belief


def updated(estimator: Estimator, noise: StateNoise, seed: int) -> Updated:
    """Update once: belief and truth are off by draws of the noise."""
    generator = draws(seed)
    belief = Belief(HERE.retract(noise.sample(generator)), noise.covariance())
    truth = ROBOT.step(HERE, HOVER, DT).retract(noise.sample(generator))
    image = picture(balls(), truth, generator)
    steps, result = collect(estimator.update(belief, image, HOVER, DT, generator))
    return Updated(steps, result, truth, predict(belief, HOVER, ROBOT, DT, noise))


@cache
def voxel_balls() -> VoxelField:
    """The same balls on a grid of 3 cm, which is rendered fast."""
    field = balls()
    points = node_positions(BOX, shape_for(BOX, 0.03))
    colors = field.radiance(points, torch.zeros_like(points))
    return VoxelField(BOX, torch.cat([raw_of(field.density(points))[..., None], colors], -1), field.background)
