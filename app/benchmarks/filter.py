"""An update of the pose filter: 300 steps of Adam in plain torch against coarse-to-fine Gauss-Newton.

Both get the same beliefs and pictures, and compare 1,024 pixels with the field.
"""

import statistics
from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from app.benchmarks.comparison import Comparison, interleaved
from app.benchmarks.plan import both_threads
from nerfnav.estimator import Belief, Estimator, FastFilter, FilterConfig, PixelConfig, PoseFilter, StateNoise
from nerfnav.experiments import Arena
from nerfnav.experiments.views import CAMERA, SUPERSAMPLE, held_out_poses, take_picture
from nerfnav.robots import ATTITUDE, POSITION, Quadrotor, RigidState
from nerfnav.world import MeshRenderer

_PIXELS = 1024
_DT = 0.1
_BELIEF = StateNoise(0.005, 0.05, 0.005, 0.05)
"""As sure as a filter at work: of position and attitude to 5 mm and 0.3 degrees, of the rates to 5 cm/s."""


@dataclass(frozen=True)
class Situation:
    """One update."""

    belief: Belief
    """Before it."""
    action: Tensor
    """What the robot did for a time step."""
    truth: RigidState
    """Where it is then."""
    image: Tensor
    """What it sees from there."""


def measure(arena: Arena, views: int = 8, rounds: int = 1, fast_per_round: int = 5) -> Comparison:
    """Time both after a step with the paper's noise, in views that the field was not learned from.

    The detail has the root mean square errors of both.
    """
    robot = Quadrotor()
    config = FilterConfig(pixels=PixelConfig(count=_PIXELS)).for_field(arena.field.info.noise_std)
    paper = PoseFilter(arena.field, robot, CAMERA, config=replace(config, retries=0))
    fast = FastFilter(arena.field, robot, CAMERA, config=config)
    with both_threads() as used:
        found = [_compare(paper, fast, one, (rounds, fast_per_round)) for one in _situations(arena, views)]
    slow_ms, fast_ms = statistics.median(row[0] for row in found), statistics.median(row[1] for row in found)
    detail = {"pixels": float(_PIXELS), "views": float(views)}
    for name, errors in (
        ("paper", torch.stack([row[2] for row in found])),
        ("fast", torch.stack([row[3] for row in found])),
    ):
        detail[f"{name}_position_rmse_m"] = _rmse(errors[:, POSITION])
        detail[f"{name}_rotation_rmse_rad"] = _rmse(errors[:, ATTITUDE])
    return Comparison("filter", slow_ms, fast_ms, used, detail)


def _situations(arena: Arena, count: int) -> Iterator[Situation]:
    """Robots that hover somewhere, are pushed, and look."""
    robot, renderer = Quadrotor(), MeshRenderer(arena.scene, supersample=SUPERSAMPLE)
    hover = torch.tensor([robot.weight, 0.0, 0.0, 0.0])
    starts = held_out_poses(arena, count)
    for index in range(count):
        generator = torch.Generator().manual_seed(index)
        truth = robot.step(starts[index], hover, _DT).retract(StateNoise().sample(generator))
        belief = Belief(starts[index].retract(_BELIEF.sample(generator)), _BELIEF.covariance())
        yield Situation(belief, hover, truth, take_picture(renderer, truth.pose))


def _compare(
    paper: Estimator, fast: Estimator, now: Situation, effort: tuple[int, int]
) -> tuple[float, float, Tensor, Tensor]:
    """Times of both [ms], and their errors in the tangent of the truth."""
    means: dict[str, RigidState] = {}

    def update(name: str, estimator: Estimator) -> None:
        generator = torch.Generator().manual_seed(0)
        *_, last = estimator.update(now.belief, now.image, now.action, _DT, generator)
        means[name] = last.mean

    update("fast", fast)
    slow_ms, fast_ms = interleaved(lambda: update("paper", paper), lambda: update("fast", fast), *effort)
    return slow_ms, fast_ms, now.truth.local(means["paper"]), now.truth.local(means["fast"])


def _rmse(errors: Tensor) -> float:
    return errors.square().sum(-1).mean().sqrt().item()
