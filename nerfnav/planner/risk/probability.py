"""Collision probability: the chance that a robot which follows a plan in closed loop touches something at least once.

Monte Carlo over the tracking error (tracking_error.py), which is a moving average of the noise of the last d steps:

    e_t = sum_{i < d} A^i w_{t-i} + A^d v_{t-d},    w ~ N(0, Q),  v ~ N(0, S)

with A, Q, S, and the relative degree d of each axis as there. So e_t has the covariance P of that module, and
neighbouring errors are correlated as those of minimum-variance control are (Aastroem, "Introduction to Stochastic
Control Theory", 1970, chapter 6: errors of prediction over d steps are a moving average of order d - 1). A sum of
chances over steps, as in terms/risk.py, counts a deviation again in each of the d steps that it lasts.

Each sampled flight follows the planned poses plus its errors of place and heading until it arrives, and hits where
the body meets dense space (sampled_flights.py). The same draws serve all plans: nothing is random, and plans that
differ little have probabilities that do.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Bool, Float

from nerfnav.field import Field
from nerfnav.planner.moving.movers import MoverBoxes, Movers
from nerfnav.planner.risk.sampled_flights import BodyCheck, SampledFlights
from nerfnav.planner.risk.tracking_error import relative_degrees
from nerfnav.robots import ATTITUDE, PAPER_NOISE, POSITION, TANGENT, Motion, NoiseModel, Robot

_ROWS = [*range(TANGENT)[POSITION], range(TANGENT)[ATTITUDE][-1]]
"""Errors that count, in the tangent of a state: of the place, and of the heading of a level body."""
_HEIGHT = 2
"""Index of the error of the height among these."""


@dataclass(frozen=True)
class ProbabilityConfig:
    """Number of sampled flights, and of poses at which each is checked."""

    flights: tuple[int, ...] = (1024, 3072)
    """Sampled flights in each round. After both, the standard error of a probability of 0.3 % is 28 % of it."""
    hits: int = 50
    """Hits after which there is no further round: the standard error is then at most 14 % of the probability."""
    poses_per_step: int = 4
    """Poses of the body along its path through a step."""
    seed: int = 0
    """Seed of the draws, which are the same for all plans."""


RESOLUTION = 1 / sum(ProbabilityConfig.flights)
"""Least probability that sampled flights can tell from none."""


@torch.no_grad()
def collision_probability(
    field: Field,
    robot: Robot,
    motion: Motion,
    noise: NoiseModel = PAPER_NOISE,
    tolerance: float = 0.0,
    config: ProbabilityConfig | None = None,
    movers: Movers | None = None,
    time: float = 0.0,
) -> float:
    """Estimate the probability that a robot which follows a plan in closed loop touches something, from 0 to 1.

    `field` is the one that planners see, where unproven space is solid; space beyond its box is as at the border.
    `noise` disturbs the robot in each step of the plan. A flight ends where it is within `tolerance` [m] of the end of
    the plan; with 0, it flies all of it. `movers` are where they are from a `time` of the flight [s] on; the box around
    one, enlarged by the robot, counts as the mover. The result is 1 for a plan that is not finite.
    """
    config = ProbabilityConfig() if config is None else config
    if not (motion.states.position.isfinite().all() and motion.states.rotation.isfinite().all()):
        return 1.0
    check, steps, hits, flown = BodyCheck.of(field, robot.body), motion.actions.shape[-2], 0, 0
    fractions = (np.arange(config.poses_per_step) + 0.5) / config.poses_per_step
    times = time + motion.dt * (np.arange(steps)[:, None] + fractions)
    boxes = None if movers is None else movers.boxes(times.ravel(), robot.body)
    for turn, count in enumerate(config.flights):
        errors = sample_errors(robot, motion.dt, noise, steps, count, config.seed + turn)
        flights = SampledFlights.of(motion, errors, tolerance, config.poses_per_step)
        hit = check.mark_hits(flights)
        if boxes is not None:
            hit |= _mark_met(flights, boxes)
        hits, flown = hits + int(hit.sum()), flown + count
        if hits >= config.hits:
            break
    return hits / flown


def _mark_met(flights: SampledFlights, boxes: MoverBoxes) -> Bool[np.ndarray, " n"]:
    """Mark the flights that are in a box, which are at the times of all poses, before they arrive."""
    met, count = np.zeros(flights.turns.shape[1], bool), len(flights.fractions)
    for step in range(len(flights.centres) - 1):
        before, after = flights.centres[step], flights.centres[step + 1]
        along = before + flights.fractions[:, None, None] * (after - before)
        centers = boxes.centers[step * count : (step + 1) * count].repeat(len(met), axis=0)
        gaps = replace(boxes, centers=centers).gaps(along.reshape(-1, 3)).min(-1)
        met |= (gaps <= 0).reshape(count, -1).any(0) & ~flights.arrived[step]
    return met


@lru_cache(maxsize=4)
def sample_errors(
    robot: Robot, dt: float, noise: NoiseModel, steps: int, flights: int, seed: int = 0
) -> Float[np.ndarray, "times flights 4"]:
    """Draw the tracking errors of some flights at the times 0, dt, ..., steps dt: ahead, to the left and up [m], and of
    the heading [rad], in the axes of the planned heading.

    A robot on the ground keeps its height.
    """
    by_state, degrees = relative_degrees(robot, dt)
    degree = degrees[_ROWS].tolist()
    process, estimate = (part.std(torch.float64).numpy() for part in (noise.process, noise.estimate))
    powers = [torch.linalg.matrix_power(by_state, count).numpy()[_ROWS] for count in range(max(degree) + 1)]
    draws = np.random.default_rng(seed)
    pushed = draws.standard_normal((steps, flights, TANGENT), np.float32)
    known = draws.standard_normal((steps + 1, flights, TANGENT), np.float32)
    errors = np.zeros((steps + 1, flights, len(_ROWS)), np.float32)
    for row, most in enumerate(degree):
        answers = [(power[row] * process).astype(np.float32) for power in powers]
        grown = [(power[row] * estimate).astype(np.float32) for power in powers]
        for count in range(min(most, steps)):
            errors[1 + count :, :, row] += pushed[: steps - count] @ answers[count]
        for time in range(min(most, steps + 1)):  # less than d steps after the first estimate
            errors[time, :, row] += known[0] @ grown[time]
        errors[most:, :, row] += known[: max(0, steps + 1 - most)] @ grown[most]
    if robot.planar:
        errors[..., _HEIGHT] = 0.0
    return errors
