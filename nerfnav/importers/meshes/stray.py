"""Stray parts: faces far away from all others, which programs leave behind unseen and which make a place vast.

The place is the box that holds the middle half of the surface along each axis, then grows: faces that are near enough
for its size belong to it, until none is left that does. What stays outside is stray.
"""

import math
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from nerfnav.importers.core.errors import StrayPartsError
from nerfnav.importers.core.placement import Corners
from nerfnav.importers.meshes.parts import Parts
from nerfnav.importers.meshes.placement import POSSIBLE

_FAR = 2.0
"""Faces further from the place than so many of its longest edges do not belong to it."""
_MIDDLE = (0.25, 0.75)
"""Quantiles of the surface between which the place is certain to be: strays are small."""
_MARGIN = 0.05
"""Space around the place in the box that is offered, in its longest edges."""
_NAMED = 3
"""Parts whose names are listed."""


def find_stray(parts: Parts) -> Bool[np.ndarray, " f"]:
    """True for the faces that are far away from the rest."""
    triangles = parts.vertices[parts.faces]
    lower, upper = triangles.min(1), triangles.max(1)
    area = parts.areas
    box = np.array([_quantiles(middle, area) for middle in triangles.mean(1).T]).T
    near = np.zeros(len(area), bool)
    while True:
        found = _distance(lower, upper, box) <= _FAR * np.ptp(box, axis=0).max()
        if not (found & ~near).any():
            return ~near
        near |= found
        box = np.array([np.minimum(box[0], lower[near].min(0)), np.maximum(box[1], upper[near].max(0))])


def _quantiles(values: Float[np.ndarray, " f"], weights: Float[np.ndarray, " f"]) -> Float[np.ndarray, " 2"]:
    """The values below which the shares `_MIDDLE` of the weight lie."""
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    return values[order][np.searchsorted(share, np.array(_MIDDLE) * share[-1]).clip(max=len(order) - 1)]


def _distance(
    lower: Float[np.ndarray, "f 3"], upper: Float[np.ndarray, "f 3"], box: Float[np.ndarray, "2 3"]
) -> Float[np.ndarray, " f"]:
    """Distances between a box and the boxes of faces."""
    return np.linalg.norm(np.maximum(0, np.maximum(lower - box[1], box[0] - upper)), axis=1)


def leave_out_stray(
    parts: Parts, stray: Bool[np.ndarray, " f"], box: Corners | None, path: Path
) -> tuple[Parts, str]:
    """The parts, in the world [m], without the stray faces outside of the box, and a note on these.

    Raises StrayPartsError, which offers boxes with and without them, where no box is given.
    """
    main, triangles = parts.select(~stray), parts.vertices[parts.faces[stray]]
    distance = float(_distance(triangles.min(1), triangles.max(1), main.bounds).min())
    numbers = np.setdiff1d(parts.part[stray], parts.part[~stray])
    names = [parts.names[number] or f"part {number}" for number in numbers[:_NAMED]]
    named = f" ({', '.join(names)}{', ...' if len(numbers) > _NAMED else ''})" if names else ""
    what = f"{int(stray.sum())} faces{named} that are {distance:.4g} m away from the rest"
    if box is None:
        offered = _offered(main.bounds)
        can_keep = np.ptp(parts.bounds, axis=0).max() <= POSSIBLE[1]
        keeping = f", and --box {_in_words(_offered(parts.bounds))} keeps them" if can_keep else ""
        raise StrayPartsError(
            f"{path} has {what}: without them it is {_size(main.bounds)} m large, with them {_size(parts.bounds)} m",
            f"--box {_in_words(offered)} leaves them out{keeping}",
            offered,
        )
    lower, upper = np.array(box)
    outside = ((triangles.max(1) < lower) | (triangles.min(1) > upper)).any(1)
    left_out = stray.copy()
    left_out[stray] = outside
    note = f"left out, outside of the box: {what}" if outside.any() else f"kept, in the box: {what}"
    return parts.select(~left_out), note


def _size(bounds: Float[np.ndarray, "2 3"]) -> str:
    return " x ".join(f"{length:.4g}" for length in np.ptp(bounds, axis=0))


def _offered(bounds: Float[np.ndarray, "2 3"]) -> Corners:
    """A box around these bounds, rounded."""
    longest = float(np.ptp(bounds, axis=0).max())
    margin, digits = _MARGIN * longest, max(0, 2 - math.floor(math.log10(longest)))
    lower, upper = (np.round(corner, digits).tolist() for corner in (bounds[0] - margin, bounds[1] + margin))
    return (lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2])


def _in_words(box: Corners) -> str:
    """The numbers of a box as the option takes them."""
    return " ".join(f"{x:g}" if abs(x) < 1e5 else f"{x:.0f}" for corner in box for x in corner)
