"""An update of the pose filter: 300 steps of Adam in plain torch against coarse-to-fine Gauss-Newton.

Both get the same beliefs and pictures, and compare 1,024 pixels with the field.
"""

import math
import statistics
from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief, Estimator, FastFilter, FilterConfig, PixelConfig, PoseFilter, PyramidConfig
from nerfnav.estimator.gauss_newton.alignment import align, start_at_mean
from nerfnav.estimator.gauss_newton.posterior import UpdateProblem, compute_posterior
from nerfnav.experiments import Arena
from nerfnav.experiments.arena import SUPERSAMPLE, held_out_poses, take_picture
from nerfnav.robots import ATTITUDE, CAMERA, POSITION, Quadrotor, RigidState, StateNoise
from nerfnav.world import MeshRenderer
from nerfnav_app.benchmarks.comparison import Comparison, both_threads, milliseconds, time_interleaved

_PIXELS = 1024
_DT = 0.1
_BELIEF = StateNoise(0.005, 0.05, 0.005, 0.05)
"""As sure as a filter at work: of position and attitude to 5 mm and 0.3 degrees, of the rates to 5 cm/s."""


@dataclass(frozen=True)
class Situation:
    """Inputs of an update, and the truth."""

    belief: Belief
    """Before it."""
    action: Tensor
    """What the robot did for a time step."""
    truth: RigidState
    """Where it is then."""
    image: Tensor
    """What it sees from there."""

    def updated(self, estimator: Estimator) -> RigidState:
        """Update the belief with an estimator."""
        update = estimator.update(self.belief, self.image, self.action, _DT, torch.Generator().manual_seed(0))
        return run_steps(update).step.mean


def measure(arena: Arena, views: int = 8, rounds: int = 1, fast_per_round: int = 5) -> Comparison:
    """Time both after a step with the paper's noise, in views that the field was not learned from.

    The detail has the root mean square errors of both, and the 95th percentile of the fast one's time where it must
    search from many starts.
    """
    fast = bench_filter(arena)
    paper = PoseFilter(arena.field, fast.robot, CAMERA, config=replace(_config(arena), retries=0))
    with both_threads() as used:
        seen = [*situations(arena, views)]
        found = [_compare(paper, fast, one, (rounds, fast_per_round)) for one in seen]
        searches = _search_times(fast, seen, fast_per_round)
    slow_ms, fast_ms = statistics.median(row[0] for row in found), statistics.median(row[1] for row in found)
    detail = {
        "pixels": float(_PIXELS),
        "views": float(views),
        "search_p95_ms": statistics.quantiles(searches, n=20, method="inclusive")[-1],
    }
    for name, errors in (
        ("paper", torch.stack([row[2] for row in found])),
        ("fast", torch.stack([row[3] for row in found])),
    ):
        detail[f"{name}_position_rmse_m"] = _rmse(errors[:, POSITION])
        detail[f"{name}_rotation_rmse_rad"] = _rmse(errors[:, ATTITUDE])
    return Comparison("filter", slow_ms, fast_ms, used, detail)


def measure_covariance(arena: Arena, views: int = 8, rounds: int = 1, fast_per_round: int = 5) -> Comparison:
    """Time the posterior at the minimum of the same updates, which no gate rejects.

    The paper's way is the exact Hessian, differentiated in plain torch; the fast one is Gauss-Newton's information,
    which the descent leaves.
    """
    fast = bench_filter(arena)
    with both_threads() as used:
        found = [_compare_covariances(fast, one, rounds, fast_per_round) for one in situations(arena, views)]
    slow_ms, fast_ms = zip(*found, strict=True)
    detail = {"pixels": float(_PIXELS), "views": float(views)}
    return Comparison("hessian", statistics.median(slow_ms), statistics.median(fast_ms), used, detail)


def _compare_covariances(fast: FastFilter, now: Situation, rounds: int, per_round: int) -> tuple[float, float]:
    """Times of both [ms]."""
    prediction, noise = fast.predict(now.belief, now.action, _DT)
    config = replace(fast.config, innovation_gate=math.inf, residual_gate=math.inf)
    problem = UpdateProblem(fast.view, config, prediction, now.image, torch.Generator().manual_seed(0), noise)
    minimum = run_steps(align(problem, config.pyramid.stages(many=False), start_at_mean(problem)))
    exact = replace(problem, config=replace(config, exact_covariance=True))
    slow_ms, fast_ms, _, _ = time_interleaved(
        lambda: compute_posterior(exact, minimum), lambda: compute_posterior(problem, minimum), rounds, per_round
    )
    return slow_ms, fast_ms


def bench_filter(arena: Arena) -> FastFilter:
    """The fast filter as it is timed."""
    return FastFilter(arena.field, Quadrotor(), CAMERA, config=_config(arena))


def _config(arena: Arena) -> FilterConfig:
    config = FilterConfig(pixels=PixelConfig(count=_PIXELS), pyramid=PyramidConfig(pixels=_PIXELS))
    return config.for_field(arena.field.info)


def _search_times(fast: FastFilter, seen: list[Situation], times: int) -> list[float]:
    """Times [ms] of updates that doubt whatever they find, and search as long as they may."""
    pyramid = fast.config.pyramid
    doubting = replace(pyramid, search=replace(pyramid.search, doubt=0.0))
    searching = replace(fast, config=replace(fast.config, pyramid=doubting))
    return [milliseconds(lambda: one.updated(searching)) for one in seen for _ in range(times)]  # noqa: B023


def situations(arena: Arena, count: int) -> Iterator[Situation]:
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
    slow_ms, fast_ms, by_paper, by_fast = time_interleaved(
        lambda: now.updated(paper), lambda: now.updated(fast), *effort
    )
    return slow_ms, fast_ms, now.truth.local(by_paper), now.truth.local(by_fast)


def _rmse(errors: Tensor) -> float:
    return errors.square().sum(-1).mean().sqrt().item()
