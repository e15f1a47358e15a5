"""Where does Adam step: in the tangent of the last state, or always in that of the prediction? (paper Eq. 8)

    recursive   x_k+1 = x_k (+) d_k            every step in the tangent of the state before it
    single      x_k+1 = x_0 (+) (d_0 + ... + d_k)   all in the tangent plane of the prediction

Both start from the same wrong poses and minimise the same cost, of a picture of the mesh reduced to a quarter: the
large errors would be hopeless at full size, with either. For small errors the two planes are alike; the further the
attitude has to turn, the more the single plane is bent against it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import fmean, median

import torch
from matplotlib.figure import Figure

from nerfnav.estimator.belief import Belief
from nerfnav.estimator.cost import PoseCost
from nerfnav.estimator.descent import DescentConfig, descend
from nerfnav.estimator.noise import StateNoise
from nerfnav.estimator.photometric import ColorNoise
from nerfnav.estimator.pyramid import View, small_observation
from nerfnav.estimator.retraction import retract
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.figures import COLORS, panels
from nerfnav.experiments.study import ExperimentStep, Results, Row, Study, run_trials
from nerfnav.experiments.views import CAMERA, SUPERSAMPLE, held_out_poses, take_picture
from nerfnav.field.levels import levels_of
from nerfnav.geometry.camera import FORWARD_MOUNT
from nerfnav.robots.state import ATTITUDE, POSITION, TANGENT
from nerfnav.world.raycast import MeshRenderer

METHODS = {"recursive": True, "single plane": False}
"""The contenders, and whether each steps in the tangent of the last state."""
SMALL, LARGE = 0.05, 0.6
"""Errors of the first attitude [rad]."""
_TRIALS, _ITERATIONS, _PIXELS, _HALVINGS = 4, 120, 256, 2
_OFF = 0.02
"""Error of the first position, along each axis [m]."""
_RATE = 0.02
"""Adam's first step of an attitude number [rad], so that both can reach the truth."""


@dataclass(frozen=True)
class Start:
    """One trial."""

    seed: int
    """Of the place and the error."""
    error: float
    """Angle by which the first attitude is off [rad]."""
    iterations: int = _ITERATIONS
    """Adam's steps."""


def run(study: Study) -> Iterator[ExperimentStep]:
    """Go down from every start both ways; the table has a line for each start, method and iteration."""
    seeds = range(study.seed, study.seed + (study.trials or _TRIALS))
    starts = [Start(seed, error) for error in (SMALL, LARGE) for seed in seeds]
    tables = yield from run_trials(study, "going down", compare, starts)
    rows = tuple(row for table in tables for row in table)
    yield Results(summary_of(rows), rows, {"tangent": picture(rows)})


def compare(arena: Arena, start: Start) -> list[Row]:
    """Cost and pose error of both over the iterations."""
    generator = torch.Generator().manual_seed(start.seed)
    truth = held_out_poses(arena, 1, start.seed)[0]
    image = take_picture(MeshRenderer(arena.scene, supersample=SUPERSAMPLE), truth.pose)
    view = View(levels_of(arena.field, 1 + _HALVINGS), CAMERA, FORWARD_MOUNT).at(_HALVINGS)
    error = torch.zeros(TANGENT)
    error[POSITION] = _OFF * torch.randn(3, generator=generator)
    error[ATTITUDE] = start.error * torch.nn.functional.normalize(torch.randn(3, generator=generator), dim=0)
    wide = StateNoise(_OFF, _OFF, start.error, _OFF)
    prediction = Belief(truth.retract(error), wide.covariance())
    colors = ColorNoise(std=arena.field.info.noise_std or ColorNoise.std)
    cost = PoseCost.of(small_observation(image, view, _PIXELS, generator), prediction, colors)
    rows = []
    for method, recursive in METHODS.items():
        config = DescentConfig(start.iterations, attitude_rate=_RATE, recursive=recursive)
        for iteration, (state, terms) in enumerate(descend(cost, prediction.mean, config, retract)):
            off = truth.local(state)
            rows.append({
                "seed": start.seed, "start_rad": start.error, "method": method, "iteration": iteration,
                "cost": terms.total.item(), "position_m": off[POSITION].norm().item(),
                "rotation_rad": off[ATTITUDE].norm().item(),
            })  # fmt: skip
    return rows


def summary_of(rows: Sequence[Row]) -> Row:
    """For small and large errors: what is left in the end, and how soon the cost is within a tenth of its way down."""
    return {
        f"from_{error:g}_rad": {
            method: _summary([row for row in rows if row["start_rad"] == error and row["method"] == method])
            for method in METHODS
        }
        for error in (SMALL, LARGE)
    }


def _summary(rows: Sequence[Row]) -> Row:
    runs = [[row for row in rows if row["seed"] == seed] for seed in sorted({row["seed"] for row in rows})]
    return {
        "trials": len(runs),
        "final_cost_mean": fmean(run[-1]["cost"] for run in runs),
        "final_position_m_median": median(run[-1]["position_m"] for run in runs),
        "final_rotation_rad_median": median(run[-1]["rotation_rad"] for run in runs),
        "converged": sum(run[-1]["rotation_rad"] < SMALL and run[-1]["position_m"] < SMALL for run in runs),
        "iterations_to_a_tenth_median": median(_iterations_down(run) for run in runs),
    }


def _iterations_down(run: Sequence[Row], left: float = 0.1) -> int:
    """First iteration from which on no more than a share of the way down is left."""
    costs = [row["cost"] for row in run]
    bound = min(costs) + left * (costs[0] - min(costs))
    return max((index + 1 for index, cost in enumerate(costs) if cost > bound), default=0)


def picture(rows: Sequence[Row]) -> Figure:
    """Cost and attitude error over the iterations, from small and from large errors: medians, and all trials."""
    names = {"cost": "cost", "rotation_rad": "attitude error [rad]"}
    figure, axes = panels([f"From {error:g} rad: {unit}" for error in (SMALL, LARGE) for unit in names.values()])
    for place, (error, name) in enumerate((error, name) for error in (SMALL, LARGE) for name in names):
        for method, color in zip(METHODS, COLORS, strict=False):
            mine = [row for row in rows if row["start_rad"] == error and row["method"] == method]
            curves = torch.tensor([
                [row[name] for row in mine if row["seed"] == seed] for seed in sorted({row["seed"] for row in mine})
            ])  # fmt: skip
            axes[place].plot(curves.T.numpy(), color=color, alpha=0.25, linewidth=0.8)
            axes[place].plot(curves.median(0).values.numpy(), color=color, label=method)
        axes[place].set(yscale="log", xlabel="iteration")
    axes[0].legend(frameon=False)
    return figure
