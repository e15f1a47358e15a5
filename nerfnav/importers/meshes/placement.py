"""Placement of a mesh: up axis and length of a unit, as given, declared, or guessed.

Units: the declared one, then the usual ones, until the longest edge of the place has a plausible length. Up: that of
the format, unless the file's other axis is much flatter and its mass lies much lower, as that of places does.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from nerfnav.importers.core.errors import MeshFileError
from nerfnav.importers.core.placement import (
    AXES,
    LOWER,
    PLAUSIBLE,
    Placement,
    direction_name,
    is_flatter,
    rotation_to_z,
)
from nerfnav.importers.meshes.files import Declaration
from nerfnav.importers.meshes.parts import Parts

METERS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Lengths of units [m]."""
POSSIBLE = (0.02, 5000.0)
"""Longest edges with which anything can be done [m]."""
_FAR_OFF = 50.0
"""A mesh further from its origin than so many of its longest edges is moved there: single precision ends somewhere."""


@dataclass(frozen=True, eq=False)
class PlacedMesh:
    """A mesh in the world, Z-up and in metres, and what was guessed to get it there."""

    parts: Parts
    """Its faces."""
    up: str
    """The direction in the file that is up now."""
    scale: float
    """Metres in one unit of the file."""
    guesses: tuple[str, ...]
    """Sentences for the user."""


def place_mesh(
    parts: Parts,
    declared: Declaration,
    placement: Placement,
    units: str | None,
    path: Path,
    stray: Bool[np.ndarray, " f"],
) -> PlacedMesh:
    """Turn, scale and, where it is far off, move a mesh; its `stray` faces have no say in that.

    Raises MeshFileError for sizes that nothing can be.
    """
    main = parts.select(~stray) if stray.any() else parts
    guesses: list[str] = []
    if placement.up is not None:
        up = np.array(placement.up) / np.linalg.norm(placement.up)
    else:
        axis, why = _up_of(main, declared)
        up = np.array(AXES[axis])
        guesses.append(f"up is {axis} {why}")
    longest = float(np.ptp(main.bounds, axis=0).max())
    scale = placement.meters_per_unit if units is None else METERS[units]
    if scale is None:
        scale, why = _scale_of(longest, declared)
        unit = next((name for name, meters in METERS.items() if meters == scale), f"units of {scale:g} m")
        guesses.append(f"lengths are in {unit} {why}")
    if not POSSIBLE[0] <= scale * longest <= POSSIBLE[1]:
        raise MeshFileError(
            f"{path} would be {scale * longest:.3g} m long, but only {POSSIBLE[0]:g} to {POSSIBLE[1]:g} m can be "
            "worked with: give its --units or --scale"
        )
    vertices, core = (scale * points @ rotation_to_z(up).T for points in (parts.vertices, main.vertices))
    lower, upper = core.min(0), core.max(0)
    if np.abs(core).max() > _FAR_OFF * scale * longest:
        offset = np.array([*(0.5 * (lower + upper))[:2], lower[2]])
        vertices = vertices - offset
        guesses.append(f"moved by {', '.join(f'{-x:.1f}' for x in offset)} m to the origin, from which it was far off")
    return PlacedMesh(replace(parts, vertices=vertices), direction_name(up), scale, tuple(guesses))


def _up_of(parts: Parts, declared: Declaration) -> tuple[str, str]:
    """The axis that is up, and why."""
    own = declared.up
    if declared.up_is_certain:
        return own, "(the file says so)"
    other = "z" if own == "y" else "y"
    middle = {axis: _middle(parts, "xyz".index(axis)) for axis in (own, other)}
    flatter = is_flatter(np.ptp(parts.bounds, axis=0), "xyz".index(own), "xyz".index(other))
    if flatter and middle[own] - middle[other] > LOWER:
        return other, f"(guessed: along {other} it is flat and heavy below; {own} is the habit of its format)"
    return own, "(the habit of its format)"


def _middle(parts: Parts, axis: int) -> float:
    """Centre of the surface along an axis, between 0 at the lowest and 1 at the highest point."""
    area = parts.areas
    lower, upper = parts.bounds[:, axis]
    along = (parts.vertices[parts.faces, axis].mean(1) - lower) / max(upper - lower, 1e-12)
    return float((area * along).sum() / area.sum())


def _scale_of(longest: float, declared: Declaration) -> tuple[float, str]:
    """Metres in one unit, and why."""
    given = [] if declared.meters is None else [declared.meters]
    tried = given + [METERS[name] for name in declared.units]
    for scale in tried:
        if PLAUSIBLE[0] <= scale * longest <= PLAUSIBLE[1]:
            guess = f"guessed: so it is {scale * longest:.3g} m long"
            return scale, f"({'the file says so' if given and scale == given[0] else guess})"
    possible = [scale for scale in tried if POSSIBLE[0] <= scale * longest <= POSSIBLE[1]]
    scale = (possible or tried)[0]
    return scale, f"(a doubtful guess: so it is {scale * longest:.3g} m long)"


