"""Flood: find the part of a place that a click means, such as a chair, by what is connected above its support.

Nodes around the click that are solid make regions, each connected within its layer of equal height; regions of
neighbouring layers that lie on each other are joined. From the click's layer downward, the part is all that is joined
to the click by nodes at that height or above, until the next layer is a support: its regions have at least twice the
area of any layer of the part, and more by a share of the area that is searched. So a lamp on a table is a part without
the table, and a table one with its legs and the lamp.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import scipy
from jaxtyping import Bool, Int

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import GridField, density_at
from nerfnav.obstacles.motions import Vector

_REACH = 140
"""Distance from the click up to which is searched along each axis, in nodes of the field."""
_NEAR = 4
"""Distance from the click to the nearest solid node, at most [nodes]."""
_SUPPORT, _WIDER = 2.0, 0.02
"""Area of a support in areas of the part, and by how much it is larger, as a share of what is searched."""
_ROUGH = 2
"""Layers above a support that its own roughness may reach into, where it joins what stands on it [nodes]."""
_MARGIN = 1.5
"""Distance of the box from the part at its sides and above it [nodes]: its density ends there."""
_SLANTED = 0.9
"""Share of the area of the upright box of a part below which a turned one is taken."""


@dataclass(frozen=True)
class PartBox:
    """Upright box around a part of a place."""

    extents: Vector
    """Edge lengths [m]."""
    position: Vector
    """Middle [m]."""
    yaw: float
    """Turn about the vertical [rad]."""


def find_part(field: GridField, click: Vector) -> PartBox:
    """Return the box around the part of a field that stands at a point [m] of its surface.

    Raises InvalidInputError where nothing stands there, and where the part goes on beyond the place or what is
    searched, as walls and floors do.
    """
    at, spacing = np.array(click), field.spacing.double().numpy()
    low, high = (corner.double().numpy() for corner in (field.box.lower, field.box.upper))
    reach = _REACH * spacing
    first = np.ceil((np.maximum(low, at - reach) - low) / spacing - 1e-6).astype(int)
    last = np.floor((np.minimum(high, at + reach) - low) / spacing + 1e-6).astype(int)
    lower, counts = low + spacing * first, last - first + 1
    layer = np.stack(np.meshgrid([0], *map(np.arange, counts[1:]), indexing="ij"), -1).reshape(-1, 3) * spacing + lower
    solid = np.empty(counts, bool)
    for x in range(counts[0]):  # one by one: all at once would take a gigabyte
        density = density_at(field, layer + np.array([x * spacing[0], 0, 0]))
        solid[x] = (density > field.solid_density).reshape(counts[1:])
    part, support = _flood(solid, _nearest(solid, (at - lower) / spacing))
    if part[[0, -1]].any() or part[:, [0, -1]].any():
        raise InvalidInputError(
            f"what is clicked goes on beyond the place, or for more than {reach[:2].min():.1f} m, as a wall or a floor "
            "does: click onto something that stands free, or select by a box volume"
        )
    height = None if support < 0 else float(lower[2] + spacing[2] * support)
    return _box_around(lower + spacing * np.argwhere(part), spacing, height)


def _nearest(solid: Bool[np.ndarray, "x y z"], at: np.ndarray) -> tuple[int, int, int]:
    """Find the solid node nearest to a place [nodes]."""
    middle = at.round().astype(int).clip(0, np.array(solid.shape) - 1)
    lower = (middle - _NEAR).clip(0)
    x, y, z = (slice(lower[axis], middle[axis] + _NEAR + 1) for axis in range(3))
    there = np.argwhere(solid[x, y, z]) + lower
    if not len(there):
        raise InvalidInputError("the click met nothing solid: click onto a surface")
    i, j, k = there[np.linalg.norm(there - at, axis=1).argmin()].tolist()
    return i, j, k


def _flood(solid: Bool[np.ndarray, "x y z"], seed: tuple[int, int, int]) -> tuple[Bool[np.ndarray, "x y z"], int]:
    """Mark the part that a solid node belongs to; return it, and the height of its support [nodes] or -1."""
    flat = np.zeros((3, 3, 3))
    flat[:, :, 1] = 1
    regions, count = scipy.ndimage.label(solid, flat)
    layer, area = np.zeros(count + 1, int), np.bincount(regions.ravel(), minlength=count + 1)
    for height in range(solid.shape[2]):
        layer[regions[:, :, height]] = height
    area[0], layer[0] = 0, -1
    both = solid[:, :, 1:] & solid[:, :, :-1]
    joined = np.unique(np.stack([regions[:, :, 1:][both], regions[:, :, :-1][both]], 1), axis=0)
    own, support = int(regions[seed]), -1
    part = _above(seed[2], own, layer, joined)
    least = _WIDER * solid.shape[0] * solid.shape[1]
    for height in range(seed[2] - 1, -1, -1):
        wider = _above(height, own, layer, joined)
        widest, here = np.bincount(layer[part], area[part]).max(), area[wider[layer[wider] == height]].sum()
        if here >= _SUPPORT * widest and here - widest >= least:
            support = height
            break
        part = wider
    clear = [region for region in part if layer[region] > support + _ROUGH]
    nearest = np.argwhere(np.isin(regions, clear))
    if support >= 0 and len(nearest):
        i, j, k = nearest[np.linalg.norm(nearest - np.array(seed), axis=1).argmin()].tolist()
        part = _above(support + 1 + _ROUGH, int(regions[i, j, k]), layer, joined)
    return np.isin(regions, part), support


def _above(height: int, seed: int, layer: Int[np.ndarray, " n"], joined: Int[np.ndarray, "e 2"]) -> np.ndarray:
    """Find the regions that are joined to `seed` by regions at a height or above."""
    pairs = joined[layer[joined].min(1) >= height]
    graph = scipy.sparse.coo_array((np.ones(len(pairs)), pairs.T), shape=(len(layer), len(layer)))
    _, of = scipy.sparse.csgraph.connected_components(graph, directed=False)
    return np.flatnonzero(of == of[seed])


def _box_around(nodes: np.ndarray, spacing: np.ndarray, support: float | None) -> PartBox:
    """Fit a box around nodes (n, 3) [m] that ends just above the height of what they stand on [m], if there is any."""
    low, high = nodes.min(0), nodes.max(0)
    bottom = low[2] - _MARGIN * spacing[2] if support is None else support + 0.5 * spacing[2]
    top = high[2] + _MARGIN * spacing[2]
    (x, y), (wide, deep), yaw = (low[:2] + high[:2]) / 2, high[:2] - low[:2], 0.0
    turned = cv2.minAreaRect(np.unique(nodes[:, :2], axis=0).astype(np.float32))
    if turned[1][0] * turned[1][1] < _SLANTED * wide * deep:
        (x, y), (wide, deep), yaw = turned[0], turned[1], float(np.radians(turned[2]))
    edges = wide + 2 * _MARGIN * spacing[0], deep + 2 * _MARGIN * spacing[1], top - bottom
    place = x, y, (top + bottom) / 2
    (a, b, c), (u, v, w) = ([round(float(number), 4) for number in numbers] for numbers in (edges, place))
    return PartBox((a, b, c), (u, v, w), round(yaw, 4))
