"""Transmittance table: the light that samples stop, by raw density, quicker than three transcendental functions.

exp(-o) and do/draw are functions of the raw density alone.
"""

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW

PER_RAW, HIGHEST_RAW = 32, 16
"""Entries of the table for each unit of raw density, and where it ends."""
STOPPED = np.float32(3e-5)
"""Transmittance below which the rest of a ray cannot be seen."""
FAINT, DIM = 5e-3, np.float32(5e-3)
"""Share of the light that a sample must stop to count in a descent, and share below which the rest is not seen."""


def faint_raw(scale: float, step: float) -> np.float32:
    """The raw density of samples that stand for `step` [m] and stop `FAINT` of the light."""
    share = -np.log1p(-FAINT) / (scale * step)
    return max(np.float32(np.log(np.expm1(share))), NEGLIGIBLE_RAW)


def tabled() -> np.ndarray:
    """The raw densities of a table's entries."""
    return float(NEGLIGIBLE_RAW) + np.arange((HIGHEST_RAW - int(NEGLIGIBLE_RAW)) * PER_RAW + 1) / PER_RAW


@kernel()
def entry_at(table, raw):
    """The entry of a table before a raw density, and how far beyond that it is, 0 to 1."""
    place = min((raw - NEGLIGIBLE_RAW) * np.float32(PER_RAW), np.float32(table.shape[0]) - np.float32(1.001))
    entry = int(place)
    return entry, place - np.float32(entry)


@kernel()
def column_at(table, place, column):
    """A column of a table at a place that `entry_at` has found, linear between entries."""
    entry, beyond = place
    here = table[entry, column]
    return here + beyond * (table[entry + 1, column] - here)


def light_table(scale: float, step: float) -> np.ndarray:
    """exp(-o) and do/draw (entries, 2) of samples that stand for `step` [m], by raw density from NEGLIGIBLE_RAW on.

    Between entries both are linear to about 1e-4 of what a sample stops.
    """
    raw = tabled()
    depth, slope = scale * step * np.logaddexp(0.0, raw), scale * step / (1.0 + np.exp(-raw))
    return np.stack([np.exp(-depth), slope], -1).astype(np.float32)
