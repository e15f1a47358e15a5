"""Mesh bake: make a voxel field of the triangles of a mesh, without pictures.

Free space is what is connected to places where a camera may stand. Space wider than four voxels is divided into
components, those without such a place are left out, and the others grow back into what is narrower, but never through
a triangle: a flood from anywhere would fill walls and the underside of floors. With h the voxel and d the exact
distance of a node from the nearest triangle, s = d in what is reached, -d elsewhere, and

    rho(s) = SLOPE log(2) / h exp(-SLOPE s / h)         half of the light is stopped where s = 0

whose logarithm is linear, so that grids interpolate it exactly before flat surfaces.

A sheet, with free space on both sides, is solid for a voxel behind it. Which side that is follows from one direction
for the whole mesh, as the orientation of faces is arbitrary in many files. Nodes that are reached and farther than a
voxel from all triangles are proven free.

Colours are Gaussian means of samples on the surface around a node's nearest point, of the side that the node sees.
"""

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
import scipy
import torch
from jaxtyping import Bool, Float, Int, Shaped

from nerfnav.core.jit import default_threads, threads
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.occupancy import EMPTY_RAW, classify_nodes, raw_of
from nerfnav.field.edit.bake import EditStep
from nerfnav.field.kernels.triangles import cross_edges, grow, nearest_triangles, splat_colors
from nerfnav.field.models.grid_field import grey_nodes
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import Box, dilate_nodes, shape_for, spacing_of

_SLOPE, _DENSEST = 8.0, 2.0
"""Rise of raw density in a voxel towards the inside, and the largest one."""
_BAND = 2.25
"""Distance from triangles within which it is computed [voxels]."""
_WIDE, _BORDER = 2.0, 3
"""Distance from all triangles of space that is divided into components [voxels], and layers of nodes along the box's
sides that join none: outside of closed rooms, they would join what they surround."""
_PLACES = 48
"""Nodes of a component, drawn at random, that are asked whether a camera may stand there."""
_GROWTH = ((0.5, 10), (0.0, 2))
"""Distance from triangles above which space is reached again [voxels], and steps."""
_FRONT = np.array([0.37, 0.53, 0.76])
"""Direction that the front of a face looks to: along no axis, so that the faces of a flat sheet agree."""
_SAMPLES = 4.0
"""Samples of colour on the surface in a square voxel."""
_EVEN = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of the R2 sequence along both edges of a face."""
_MOST_SAMPLES = 30_000_000
_AT_ONCE = 1 << 20
_NEAR = 1.5
"""Distance of nodes that tell which side of a face is seen [voxels]."""

SurfaceColor = Callable[[Int[np.ndarray, " n"], Float[np.ndarray, "n 3"]], Shaped[np.ndarray, "n 3"]]
"""sRGB colours, 0 to 255, at points given by their faces and their weights of the three corners."""
PlaceTest = Callable[[Float[np.ndarray, "n 3"]], Bool[np.ndarray, " n"]]
"""Mark points [m] at which a camera may stand."""


@dataclass(frozen=True)
class MeshSurface:
    """Surface of a mesh, as it is baked."""

    triangles: Float[np.ndarray, "f 3 3"]
    """Corners [m]."""
    color: SurfaceColor
    """Colours of the faces."""


@dataclass(frozen=True)
class _Grid:
    """Nodes to fill."""

    lower: Float[np.ndarray, "3"]
    spacing: Float[np.ndarray, "3"]
    shape: tuple[int, int, int]

    @property
    def voxel(self) -> float:
        return float(self.spacing.max())

    def positions(self, nodes: Int[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        return self.lower + nodes * self.spacing


def bake_mesh(
    surface: MeshSurface, box: Box, voxel: float, background: Float[torch.Tensor, "3"], is_place: PlaceTest
) -> Generator[EditStep, None, VoxelField]:
    """Yield progress, and return a field of the triangles in `box`, with nodes `voxel` [m] apart.

    Where no component has a place for a camera, nothing is free. Takes 40 bytes a node.
    """
    shape = shape_for(box, voxel)
    spacing = spacing_of(box, shape).double().numpy()
    grid = _Grid(box.lower.double().numpy(), spacing, shape)
    triangles = np.ascontiguousarray(surface.triangles, float)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(normals, axis=1)
    whole = area > 0
    # of faces without an area nothing is seen, and their edges belong to others
    faces = np.flatnonzero(whole)
    triangles, area = triangles[whole], 0.5 * area[whole]
    normals = normals[whole] / (2 * area[:, None])
    normals *= np.where(normals @ _FRONT < 0, -1.0, 1.0)[:, None]
    with threads(default_threads()):
        yield EditStep("measuring distances from the mesh", 0.0)
        distance, nearest = np.full(shape, np.inf, np.float32), np.full(shape, -1, np.int32)
        nearest_triangles(triangles, normals, grid.lower, spacing, _BAND * grid.voxel, distance, nearest)
        yield EditStep("finding free space", 0.4)
        reached, behind = _reach(grid, triangles, normals, distance, is_place)
        signed = _signed(grid, triangles, normals, distance, nearest, reached, behind)
    yield EditStep("colouring the surface", 0.6)
    color = yield from _colors(grid, replace(surface, triangles=triangles), faces, normals, area, signed, nearest)
    return _field(grid, box, background, signed, color)


def _reach(
    grid: _Grid,
    triangles: Float[np.ndarray, "f 3 3"],
    normals: Float[np.ndarray, "f 3"],
    distance: Float[np.ndarray, "nx ny nz"],
    is_place: PlaceTest,
) -> tuple[Bool[np.ndarray, "nx ny nz"], Bool[np.ndarray, "nx ny nz"]]:
    """Nodes of free space, and those behind sheets that have it on both sides."""
    crossed, reached = np.zeros((2, *grid.shape), np.uint8)
    behind = np.zeros(grid.shape, bool)
    cross_edges(triangles, normals, grid.lower, grid.spacing, reached, crossed, behind)
    wide = distance > _WIDE * grid.voxel
    inner = tuple(slice(_BORDER, count - _BORDER) for count in grid.shape)
    label, count = scipy.ndimage.label(wide[inner])
    flat = label.ravel()
    nodes = np.flatnonzero(flat)
    order = nodes[np.argsort(flat[nodes], kind="stable")]
    ends = np.cumsum(np.bincount(flat[nodes], minlength=count + 1)[1:])
    random = np.random.default_rng(0)
    some = [part[random.integers(len(part), size=_PLACES)] for part in np.split(order, ends[:-1])] if count else []
    asked = np.concatenate([np.zeros(0, int), *some])
    found = is_place(grid.positions(np.stack(np.unravel_index(asked, label.shape), -1) + _BORDER))
    chosen = np.zeros(count + 1, np.uint8)
    chosen[flat[asked[found]]] = 1
    reached[inner] = chosen[label]
    for least, steps in _GROWTH:
        room = np.empty((reached.size - np.count_nonzero(reached), 3), np.int32)
        grow(reached, distance, crossed, np.float32(least * grid.voxel), steps, room)
        np.minimum(reached, 1, out=reached)
    cross_edges(triangles, normals, grid.lower, grid.spacing, reached, crossed, behind)
    return reached > 0, behind


def _signed(
    grid: _Grid,
    triangles: Float[np.ndarray, "f 3 3"],
    normals: Float[np.ndarray, "f 3"],
    distance: Float[np.ndarray, "nx ny nz"],
    nearest: Int[np.ndarray, "nx ny nz"],
    reached: Bool[np.ndarray, "nx ny nz"],
    behind: Bool[np.ndarray, "nx ny nz"],
) -> Float[np.ndarray, "nx ny nz"]:
    """Distance from the surface [m], negative in what is solid; infinite far from it in free space, -infinite else."""
    signed = np.where(reached, distance, -distance)
    beside = dilate_nodes(torch.from_numpy(behind)).numpy()
    nodes = np.argwhere(beside & reached & (distance < grid.voxel))
    index = tuple(nodes.T)
    face = nearest[index]
    side = np.einsum("ni,ni->n", normals[face], grid.positions(nodes) - triangles[face, 0])
    signed[index] *= np.where(side < 0, -1, 1)
    return signed


def _colors(
    grid: _Grid,
    surface: MeshSurface,
    faces: Int[np.ndarray, " f"],
    normals: Float[np.ndarray, "f 3"],
    area: Float[np.ndarray, " f"],
    signed: Float[np.ndarray, "nx ny nz"],
    nearest: Int[np.ndarray, "nx ny nz"],
) -> Generator[EditStep, None, Float[np.ndarray, "nx ny nz 3"]]:
    """Colours of the nodes near the surface; grey elsewhere."""
    triangles = surface.triangles
    nodes = np.argwhere((signed > 0) & (signed < _NEAR * grid.voxel))
    face = nearest[tuple(nodes.T)]
    ahead = np.einsum("ni,ni->n", normals[face], grid.positions(nodes) - triangles[face, 0]) > 0
    before, after = (np.bincount(face[part], minlength=len(triangles)) for part in (ahead, ~ahead))
    facing = np.where(after == 0, 1.0, np.where(before == 0, -1.0, 0.0)) * (before + after > 0)
    # hidden faces are left out; small ones may have no node of their own
    shown = (before + after > 0) | (area < grid.voxel**2)
    rate = min(_SAMPLES / grid.voxel**2, _MOST_SAMPLES / max(area[shown].sum(), 1e-12))
    random = np.random.default_rng(0)
    counts = np.floor(rate * area * shown + random.random(len(area))).astype(int) * shown
    drawn = np.repeat(np.arange(len(area)), counts)
    sums = np.zeros((*grid.shape, 4), np.float32)
    lattice = (grid.lower, grid.spacing, grid.voxel)
    for start in range(0, len(drawn), _AT_ONCE):
        some = drawn[start : start + _AT_ONCE]
        # evenly spread in each face (Roberts' R2 sequence), folded into the triangle
        a, b = ((start + np.arange(len(some)))[:, None] * _EVEN % 1).T
        beyond = a + b > 1
        a, b = np.where(beyond, 1 - a, a), np.where(beyond, 1 - b, b)
        weights = np.stack([1 - a - b, a, b], -1)
        points = np.einsum("nk,nki->ni", weights, triangles[some])
        # in the order of the nodes, or memory is read here and there: three times as fast
        cells = ((points - grid.lower) / grid.spacing).astype(int)
        order = np.argsort(np.ravel_multi_index(tuple(cells.T), grid.shape, mode="clip"))
        points, weights, some = points[order], weights[order], some[order]
        colors = surface.color(faces[some].astype(np.int32), weights.astype(np.float32)).astype(np.float32)
        about = (normals, np.ascontiguousarray(triangles[:, 0]), facing, nearest)
        splat_colors(lattice, (points, colors, some), about, signed, sums)
        yield EditStep("colouring the surface", 0.6 + 0.4 * start / len(drawn))
    color, seen = np.full((*grid.shape, 3), 0.5, np.float32), sums[..., 0] > 0
    color[seen] = sums[seen, 1:] / (255 * sums[seen, :1])
    return color


def _field(
    grid: _Grid,
    box: Box,
    background: Float[torch.Tensor, "3"],
    signed: Float[np.ndarray, "nx ny nz"],
    color: Float[np.ndarray, "nx ny nz 3"],
) -> VoxelField:
    share = torch.from_numpy(signed) / grid.voxel
    values = grey_nodes(grid.shape, EMPTY_RAW)
    raw = (raw_of(_SLOPE * math.log(2) / grid.voxel) - _SLOPE * share).clamp(EMPTY_RAW, _DENSEST)
    # farther inside than a band that stops all light, nothing is known
    values[..., 0] = torch.where(share.abs() > _BAND, EMPTY_RAW, raw)
    values[..., 1:] = torch.from_numpy(color)
    created = datetime.now(UTC).isoformat(timespec="seconds")
    info = FieldInfo(created=created, made_by="baked", learned_from="mesh", proven_from="mesh")
    states = classify_nodes(share > 1, values[..., 0])
    return VoxelField(box, values, background, info, evidence=states)
