"""Descents of camera poses: one compiled call where the field has a grid that kernels know, else in torch."""

from collections import deque
from collections.abc import Iterator
from dataclasses import fields

import numpy as np
import torch

from nerfnav.compiled import threads
from nerfnav.estimator.kernels.descent import descend
from nerfnav.estimator.newton import UNKNOWNS, Guess, Iterate, NewtonConfig, Prior, minimise
from nerfnav.estimator.photometric import THREADS, Observation, array_of
from nerfnav.field import SightGrid, sight_grid_of
from nerfnav.geometry import Pose


def improve(
    seen: Observation, start: Guess, prior: Prior, config: NewtonConfig, every: bool = True
) -> Iterator[Iterate]:
    """Every stage on the way down, the start first, as `minimise` yields them; the last one alone, if not `every`.

    The compiled descent ends each pose's where that has settled; it then stands still in later stages. All is done on
    the filter's threads and without gradients; what others do between the stages is not.
    """
    grid = sight_grid_of(seen.field)
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
    grid: SightGrid, seen: Observation, start: Guess, prior: Prior, config: NewtonConfig, every: bool = True
) -> Iterator[Iterate]:
    mean = Pose(torch.eye(3), torch.zeros(3)) if prior.mean is None else prior.mean
    known = (
        array_of(prior.information), array_of(mean.rotation), array_of(mean.position), prior.mean is not None,
        prior.kappa, prior.slack,
    )  # fmt: skip
    count, stages = len(start.exposure), config.iterations + 1
    trace = _trace(stages, count, len(seen.pixels))
    for part, begin in zip(trace, (start.pose.rotation, start.pose.position, start.exposure), strict=False):
        part[0] = begin.numpy()
    held, moved, settings = np.empty((stages, count), np.int64), np.empty((stages, count)), _settings(config)
    stages = descend(grid, seen.sight, known, settings, trace, held, moved)
    told = slice(0 if every else stages - 1, stages)
    holding = held[told], np.arange(count)
    parts = (*(part[holding] for part in trace), moved[told])
    shown = [torch.from_numpy(np.asarray(part, np.float32)) for part in parts]
    for rotation, position, exposure, *parts in zip(*shown, strict=True):
        yield Iterate(Guess(Pose(rotation, position), exposure), **dict(zip(_PARTS, parts, strict=True)))


def _settings(config: NewtonConfig) -> tuple[int, float, float, float, float]:
    return config.iterations, config.damping, config.robust, config.settled, config.stretch


_PARTS = ("cost", "process", "residual", "change", "seen", "known", "slope", "moved")
"""In the order in which the kernel has them."""
assert {"guess", *_PARTS} == {field.name for field in fields(Iterate)}


def _trace(stages: int, poses: int, pixels: int) -> tuple[np.ndarray, ...]:
    """Room for the stages of so many poses: rotation, position, exposure, and `_PARTS` but for the last."""
    square, plain = (UNKNOWNS, UNKNOWNS), ()
    shapes = ((3, 3), (3,), (2,), plain, plain, (pixels, 3), (UNKNOWNS,), square, square, (UNKNOWNS,))
    kinds = [np.float32 if shape == (pixels, 3) else np.float64 for shape in shapes]
    return tuple(np.empty((stages, poses, *shape), kind) for shape, kind in zip(shapes, kinds, strict=True))
