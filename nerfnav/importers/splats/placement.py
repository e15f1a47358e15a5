"""Placement of splats: up direction and length of a unit, as given, else guessed as those of meshes are.

Up is the habit of the format: y for .spz, whose axes are right, up, back, and -y for all others, whose cameras come
from COLMAP. Things stand on the origin: where one end of that axis is there and the other far away, that end is
below. Else z is up where the place is much flatter along it and its opacity lies lower there, as that of places does.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from nerfnav.importers.core.placement import (
    AXES,
    LOWER,
    UNIT_ASSUMED,
    Placement,
    Vector,
    direction_name,
    format_length,
    is_flatter,
    warn_implausible_size,
)
from nerfnav.importers.splats.gaussians import Splats, robust_extent

_HABITS: dict[str, Vector] = {".spz": (0.0, 1.0, 0.0)}
_HABIT: Vector = (0.0, -1.0, 0.0)
_AT_ORIGIN = 0.03
"""Largest distance of a standing end from the origin, in lengths along its axis."""


@dataclass(frozen=True)
class SplatPlacement:
    """Placement of splats, and its guesses."""

    up: Vector
    """The direction that is up, in the file's own axes."""
    scale: float
    """Metres in one unit."""
    longest: float
    """Longest edge of what is there [m]."""
    guesses: tuple[str, ...]
    """Sentences for the user."""


def place_splats(splats: Splats, placement: Placement, path: Path) -> SplatPlacement:
    """Place splats from the file `path`: up and scale as given, else guessed."""
    guesses: list[str] = []
    lower, upper = robust_extent(splats.centers, splats.masses)
    up, scale = placement.up, placement.meters_per_unit
    longest = float((upper - lower).max()) * (scale or 1.0)
    if up is None:
        up, why = guess_up(splats, _HABITS.get(path.suffix.lower(), _HABIT))
        guesses.append(f"up is {direction_name(np.array(up))} {why}")
    if scale is None:
        guesses.append(f"{UNIT_ASSUMED}, and the place is {format_length(longest)} long")
        if (doubt := warn_implausible_size(longest)) is not None:
            guesses.append(doubt)
    return SplatPlacement(up, scale or 1.0, longest, tuple(guesses))


def guess_up(splats: Splats, habit: Vector = _HABIT) -> tuple[Vector, str]:
    """The direction that is up, and why."""
    masses, habitual = splats.masses, direction_name(np.array(habit))
    lower, upper = robust_extent(splats.centers, masses)
    size, own, z = upper - lower, int(np.abs(habit).argmax()), 2
    ends = (lower[own], upper[own]) if habit[own] > 0 else (-upper[own], -lower[own])
    standing = np.abs(ends) < _AT_ORIGIN * size[own]
    if standing[0] and not standing[1]:
        return habit, "(the habit of its format, and so it stands on the origin)"
    if standing[1] and not standing[0]:
        return _opposite(habit), f"(guessed: so it stands on the origin; {habitual} is the habit of its format)"
    heavy = _middles(splats.centers, masses, lower, upper)
    middle = heavy[own] if habit[own] > 0 else 1 - heavy[own]
    if is_flatter(size, own, z) and middle - heavy[z] > LOWER:
        why = f"(guessed: along it the place is flat and heavy below; {habitual} is the habit of its format)"
        return AXES["z"], why
    return habit, "(the habit of its format)"


def _middles(
    centers: Float[np.ndarray, "n 3"], masses: Float[np.ndarray, " n"], lower: np.ndarray, upper: np.ndarray
) -> Float[np.ndarray, " 3"]:
    """Centre of the opacity along each axis, between 0 at the lower and 1 at the upper end; 0.5 where nothing is."""
    inside = ((centers >= lower) & (centers <= upper)).all(1)
    if not inside.any():  # damaged files: each splat is far away along one axis
        return np.full(3, 0.5)
    share = (centers[inside] - lower) / np.maximum(upper - lower, 1e-12)
    weights = masses[inside] if masses[inside].any() else np.ones(int(inside.sum()))
    return np.average(share, axis=0, weights=weights)


def _opposite(up: Vector) -> Vector:
    x, y, z = (-part if part else 0.0 for part in up)
    return x, y, z
