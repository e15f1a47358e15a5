"""Smooth random patterns in space, the same on every machine: what makes stones uneven and meadows mottled."""

from functools import cache

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

_CELLS = 24


def noise(points: np.ndarray, scale: float, seed: int) -> np.ndarray:
    """A smooth pattern with bumps about `scale` metres wide, mostly between -1 and 1; points (n, 3), values (n,).

    Random numbers on a lattice that repeats after 24 cells, blended with quadratic splines.
    """
    return map_coordinates(_lattice(seed), points.T / scale, order=2, mode="grid-wrap", prefilter=False)


@cache
def _lattice(seed: int) -> np.ndarray:
    """Spline coefficients of random numbers on a lattice."""
    numbers = np.random.default_rng(seed).uniform(-1.6, 1.6, (_CELLS,) * 3)
    return spline_filter(numbers, order=2, mode="grid-wrap")


def fractal(points: np.ndarray, scale: float, seed: int, octaves: int = 3, gain: float = 0.55) -> np.ndarray:
    """A sum of noises, each half as wide as the one before and `gain` times as strong."""
    layers = [gain**k * noise(points, scale / 2**k, seed + 101 * k) for k in range(octaves)]
    return np.sum(layers, axis=0) / sum(gain**k for k in range(octaves))


def smoothstep(low: float, high: float, values: np.ndarray) -> np.ndarray:
    """0 below `low`, 1 above `high`, smooth between."""
    t = np.clip((values - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def mix(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Colours (n, 3): `first` where `share` (n,) is 0, `second` where it is 1."""
    return first + (np.asarray(second) - first) * share[:, None]
