"""Alignment from coarse to fine: select pixels, descend, and search for other minima.

Where the prediction is wide, descents start from random poses of it, the likeliest by the smallest picture.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import torch

from nerfnav.core.jit import threads
from nerfnav.estimator.core.belief import POSE, Belief
from nerfnav.estimator.core.filter_step import FilterStep
from nerfnav.estimator.gauss_newton.posterior import Minimum, Selection, UpdateProblem, is_doubtful
from nerfnav.estimator.photometric.levenberg_marquardt import POSE as _POSE
from nerfnav.estimator.photometric.levenberg_marquardt import Guess, Iterate, NewtonConfig, improve
from nerfnav.estimator.photometric.pixel_selection import choose_pixels
from nerfnav.estimator.photometric.pyramid import Stage, View, observe_reduced
from nerfnav.estimator.photometric.residuals import THREADS, Observation, difference, residuals
from nerfnav.geometry import Pose, so3

_TYPICAL_DEPTH = 0.3
"""Typical depth of a picture [share of the box's longest edge]."""


@dataclass(frozen=True)
class Start:
    """Start of an alignment."""

    guess: Guess
    """Poses (n,) and exposures."""
    selection: Selection | None = None
    """Pixels that the update has selected before."""
    iteration: int = 0
    """Iterations so far."""


@dataclass(frozen=True)
class SearchResult:
    """Result of a search for other minima."""

    best: Minimum
    """Minimum of least cost."""
    rival: Minimum | None
    """Another minimum, if one was found."""
    iteration: int
    """Iterations so far."""


def choose_start(problem: UpdateProblem, many: bool) -> Start:
    """Return the mean of the prediction; for `many` starts also the likeliest random poses of it."""
    if not many:
        return start_at_mean(problem)
    pyramid = problem.config.pyramid
    seen = _select(problem, pyramid.halvings[0], pyramid.glance, problem.prediction.mean.pose)
    poses = draw_poses(problem.prediction, pyramid.candidates, problem.generator)
    return Start(select_likeliest(seen.observation, poses, pyramid.starts), seen)


def start_at_mean(problem: UpdateProblem) -> Start:
    """Return the mean of the prediction."""
    return Start(Guess.at(problem.prediction.mean.pose[None]))


def align(problem: UpdateProblem, stages: Sequence[Stage], start: Start) -> Generator[FilterStep, None, Minimum]:
    """Descend through at least one stage, each from the likeliest poses of the one before; yields every iteration."""
    stage, *finer = stages
    minimum = yield from _descend(problem, stage, select_pixels(problem, stage, start), start)
    if not finer:
        return minimum
    return (yield from align(problem, finer, _next_start(minimum, stage.kept)))


def select_pixels(problem: UpdateProblem, stage: Stage, start: Start) -> Selection:
    """Select the pixels of a stage: fewer for many poses, all of the chosen ones in the last stage."""
    pyramid = problem.config.pyramid
    rays = len(start.guess.exposure) * (stage.iterations + 1)
    count = stage.pixels if stage.pixels == pyramid.pixels else min(stage.pixels, pyramid.rays // rays)
    return _select(problem, stage.halvings, count, start.guess.pose[0], start.selection)


def search(problem: UpdateProblem, best: Minimum, iteration: int) -> Generator[FilterStep, None, SearchResult]:
    """Improve random states of the prediction at full size, ever fewer, until one is left besides the best."""
    config, pixels = problem.config.pyramid.search, problem.config.pyramid.pixels
    *early, rivalry, last = config.stages(pixels)
    seen = _select(problem, 0, config.pixels[0], problem.prediction.mean.pose, best.selection)
    poses = draw_poses(problem.prediction, config.candidates, problem.generator)
    start = Start(select_likeliest(seen.observation, poses, config.starts, config.saturation), seen, iteration)
    if early:
        found = yield from align(problem, early, start)
        start = _next_start(found, early[-1].kept)
    start = replace(start, guess=Guess.cat([start.guess, best.iterate.guess]))
    found = yield from align(problem, [rivalry], start)
    start = _next_start(found, len(found.iterate.cost))
    ends, mine = start.guess.pose, found.iterate.guess.pose[-1]
    others = [index for index in range(len(start.guess.exposure)) if not are_alike(ends[index], mine, config.alike)]
    if not others or (others[0] and is_doubtful(problem, best)):
        return SearchResult(best, None, start.iteration)
    start = replace(start, guess=start.guess[others[0] : others[0] + 1])
    found = yield from align(problem, [last], start)
    first, second = (found, best) if found.iterate.cost[0] < best.iterate.cost[0] else (best, found)
    same = are_alike(first.iterate.guess.pose[0], second.iterate.guess.pose[0], config.alike)
    return SearchResult(first, None if same else second, found.step.iteration + 1)


def draw_poses(prediction: Belief, count: int, generator: torch.Generator) -> Pose:
    """Return the mean of a prediction, and random poses of it, batch shape (count + 1,)."""
    mean = prediction.mean
    root = torch.linalg.cholesky(prediction.covariance[POSE][:, POSE])
    draws = torch.cat([torch.zeros(1, 6), torch.randn(count, 6, generator=generator) @ root.T])
    return Pose(so3.retract(mean.rotation.expand(len(draws), 3, 3), draws[:, 3:]), mean.position + draws[:, :3])


def select_likeliest(seen: Observation, poses: Pose, count: int, saturation: float = 1.0) -> Guess:
    """Return the first of the poses (n,) and, of the others, those whose view looks most like the picture.

    Colour differences above `saturation` [1 = full scale] count as this.
    """
    best = residuals(seen, poses).abs().clamp_max(saturation).mean((1, 2)).argsort()[:count]
    return Guess.at(poses[torch.cat([torch.zeros(1, dtype=best.dtype), best[best != 0]])])


def image_deviation(prediction: Belief, view: View, halvings: int = 0) -> float:
    """Return the standard deviation of points in a picture reduced by 2^halvings, by the prediction [pixels]."""
    deviations = prediction.covariance.diagonal()[POSE].sqrt()
    depth = _TYPICAL_DEPTH * float(view.levels[0].box.size.max())
    angle = float(deviations[3:].norm() + deviations[:3].norm() / depth)
    return view.at(halvings).camera.fx * angle


def record(problem: UpdateProblem, iterate: Iterate, selection: Selection, iteration: int, best: int = 0) -> FilterStep:
    """Return an iteration as a filter step: the pose `best` of an iterate."""
    residual, pose = difference(iterate.residual[best]), iterate.guess.pose
    return FilterStep(
        iteration,
        problem.state(Pose(pose.rotation[best], pose.position[best]), iterate.change[best, _POSE]),
        float(iterate.cost[best] - iterate.process[best]),
        float(iterate.process[best]),
        selection.places,
        residual,
        pixel_source=selection.source,
    )


def _descend(
    problem: UpdateProblem, stage: Stage, selection: Selection, start: Start
) -> Generator[FilterStep, None, Minimum]:
    """Improve all poses of a start in one stage."""
    seen, pyramid = selection.observation, problem.config.pyramid
    settings = NewtonConfig(
        stage.iterations, robust=stage.robust, settled=pyramid.settled * 2**stage.halvings, stretch=pyramid.stretch
    )
    iterates = improve(seen, start.guess, problem.prior(len(seen.pixels), stage.halvings), settings, stage.every)
    here, iteration = next(iterates), start.iteration
    while True:
        step = record(problem, here, selection, iteration, int(here.cost.argmin()))
        yield step
        later = next(iterates, None)
        if later is None:
            return Minimum(step, selection, here)
        here, iteration = later, iteration + 1


def _next_start(minimum: Minimum, kept: int | None) -> Start:
    """Return the likeliest poses of a minimum (None: a third of them)."""
    return Start(minimum.iterate.likeliest(kept), minimum.selection, minimum.step.iteration + 1)


def _select(
    problem: UpdateProblem, halvings: int, count: int, pose: Pose, before: Selection | None = None
) -> Selection:
    """Select so many pixels; at full size, from those chosen once in an update for the pose at that time."""
    image, view, generator = problem.image, problem.view.at(halvings), problem.generator
    chosen = None if before is None else before.chosen
    if halvings:
        seen = observe_reduced(image, view, count, generator, problem.hidden)
        return Selection(seen, ((seen.pixels + 0.5) * 2**halvings).long(), None, chosen)
    if chosen is None:
        pyramid = problem.config.pyramid
        wanted = replace(problem.config.pixels, count=pyramid.pixels, draw=pyramid.draw)
        with threads(THREADS):
            slopes = partial(Observation.slopes, pose, view)
            chosen = choose_pixels(image, wanted, generator, slopes, problem.hidden)
    pixels = chosen.pixels
    if count < len(pixels):
        pixels = pixels[torch.randperm(len(pixels), generator=generator)[:count]]
    return Selection(Observation.of(image, pixels, view), pixels, chosen.source, chosen)


def are_alike(first: Pose, second: Pose, bounds: tuple[float, float]) -> bool:
    """Return True for two poses nearer than this: position [m], attitude [rad]."""
    return bool(
        (first.position - second.position).norm() < bounds[0]
        and so3.local(first.rotation, second.rotation).norm() < bounds[1]
    )
