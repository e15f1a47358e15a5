"""Placement: write obstacles that stand into a grid field and into the scene that is its ground truth.

With h the spacing of the nodes and s the distance of a node from an obstacle's surface, negative inside,

    rho(s) = SLOPE log(2) / h exp(-SLOPE s / h)         half of the light is stopped where s = 0

as for fields that are baked from meshes. Obstacles thinner than two nodes are as thick as that in the field, so that
none slips between nodes. Nodes count as solid or free as their density says up to a node from the surface; all others
are as they were. Cut-outs (cut_out.py) take a part of the field along.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Int

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.memory import require_memory
from nerfnav.field import Field, GridField, Occupancy, VoxelField
from nerfnav.field.core.occupancy import EMPTY_RAW, raw_of
from nerfnav.field.models.bricks import CELLS, NODES, BrickField
from nerfnav.geometry import Box
from nerfnav.obstacles.cut_out import CutOut, Nodes, cut, move_parts, paste, require_part, states_of
from nerfnav.obstacles.obstacle import Obstacle, ObstacleSet
from nerfnav.obstacles.shapes import Points

if TYPE_CHECKING:
    from nerfnav.world import Scene  # slow to import

_SLOPE, _DENSEST = 8.0, 2.0
"""Rise of raw density in a node's spacing towards the inside, and the largest one."""
_REACH = 2.0
"""Distance from the surface beyond which an obstacle changes nothing [nodes]."""
_PAINTED = 1.5
"""Distance from the surface up to which nodes have the obstacle's colour [nodes]."""


def place_in_field(field: Field, obstacles: ObstacleSet) -> GridField:
    """Return a copy of a grid field with obstacles in it, where they are at time 0.

    Raises InvalidInputError for fields of other kinds, and for an obstacle that lies outside the field's box.
    """
    if not isinstance(field, VoxelField | BrickField):
        raise InvalidInputError("obstacles are placed in fields on a grid: bake this one first, with nerfnav bake")
    require_memory(1.0 * field.values.nbytes, "a copy of the field with obstacles", "make one with a larger --voxel")
    if isinstance(field, BrickField):
        return _in_bricks(field, obstacles)
    return replace_in_field(field, obstacles, field, ObstacleSet(()))


def replace_in_field(field: VoxelField, obstacles: ObstacleSet, last: GridField, before: ObstacleSet) -> VoxelField:
    """Place obstacles in a field as `place_in_field` does, beginning with a copy of `last`, the field with others.

    What was derived of that is derived anew only where obstacles differ.
    """
    changed = {*obstacles.obstacles} ^ {*before.obstacles}
    edits = _edits(field, obstacles.obstacles)
    regions = [edit.region for edit in _edits(field, changed)]
    affected = [edit for edit in edits if any(edit.region.meets(other) for other in regions)]
    regions += [edit.region for edit in affected if edit.cuts]  # a cut takes out what stands there, too
    nodes = Nodes(last.values.clone(), None if last.evidence is None else last.evidence.clone())
    if field.evidence is None and any(edit.cuts for edit in edits):
        nodes = replace(nodes, states=states_of(last))
    states = None if nodes.states is None else states_of(field)
    for region in regions:
        nodes.values[region.slices] = field.values[region.slices]
        if nodes.states is not None and states is not None:
            nodes.states[region.slices] = states[region.slices]
    for edit in edits:
        if any(edit.region.meets(other) for other in regions):
            _write(nodes, field, edit)
    if not regions:
        return replace(field, values=nodes.values, evidence=nodes.states)
    low = np.min([region.first for region in regions], 0) - 1
    high = np.max([region.end for region in regions], 0)
    lower, spacing = field.box.lower.double().numpy(), field.spacing.double().numpy()
    placed = replace(field, values=nodes.values, evidence=nodes.states)
    return placed.differing_from(last, Box.of(lower + low * spacing, lower + high * spacing))


@dataclass(frozen=True)
class _Edit:
    """Change of the nodes in a region."""

    region: "_Region"
    change: Callable[[Nodes, Points], Nodes]
    """New values (n, 4) and states (n) of nodes at points (n, 3) [m]."""
    cuts: bool = False
    """True if it takes something out; that comes before all else."""


def _edits(field: GridField, obstacles: Iterable[Obstacle]) -> list[_Edit]:
    """List the changes of a field by obstacles, in their order."""
    cuts, others = list[_Edit](), list[_Edit]()
    for obstacle in obstacles:
        shape, region = obstacle.shape, _region(field, obstacle)
        if isinstance(shape, CutOut):
            cuts.append(_Edit(_region(field, shape.source), partial(cut, shape), cuts=True))
            others.append(_Edit(region, partial(paste, field, obstacle)))
        else:
            others.append(_Edit(region, partial(_merge, field, obstacle)))
    return [*cuts, *others]


@dataclass(frozen=True)
class _Region:
    """Nodes of the grid near an obstacle: the first, and the one after the last, along each axis."""

    first: Int[np.ndarray, "3"]
    end: Int[np.ndarray, "3"]

    def meets(self, other: "_Region") -> bool:
        """Check for common nodes."""
        return bool((np.maximum(self.first, other.first) < np.minimum(self.end, other.end)).all())

    @property
    def slices(self) -> tuple[slice, ...]:
        return tuple(slice(int(low), int(high)) for low, high in zip(self.first, self.end, strict=True))


def _region(field: GridField, obstacle: Obstacle) -> _Region:
    boxes = ObstacleSet((obstacle,)).boxes([0.0])
    lower, spacing = field.box.lower.double().numpy(), field.spacing.double().numpy()
    reach = _REACH * field.resolution + _thickening(obstacle, field.resolution)
    middle, half = boxes.centers[0, 0], boxes.halves[0]
    require_inside(field, obstacle)
    first = np.floor((middle - half - reach - lower) / spacing).astype(int)
    end = np.ceil((middle + half + reach - lower) / spacing).astype(int) + 1
    return _Region(first.clip(0, field.shape), end.clip(0, field.shape))


def require_placeable(field: Field, obstacle: Obstacle) -> None:
    """Raise InvalidInputError for an obstacle that lies outside the field's box, or is a cut-out of nothing."""
    if isinstance(obstacle.shape, CutOut):
        require_part(field, obstacle)
    require_inside(field, obstacle)


def require_inside(field: Field, obstacle: Obstacle) -> None:
    """Raise InvalidInputError for an obstacle that lies outside the field's box."""
    boxes = ObstacleSet((obstacle,)).boxes([0.0])
    middle, half = boxes.centers[0, 0], boxes.halves[0]
    lower, size = field.box.lower.double().numpy(), field.box.size.double().numpy()
    if (middle + half < lower).any() or (middle - half > lower + size).any():
        place = ", ".join(f"{axis} {at:.2f}" for axis, at in zip("xyz", middle, strict=True))
        raise InvalidInputError(
            f"the obstacle {obstacle.name!r} at {place} m lies outside the place, which is {field.box.describe()}"
        )


def _thickening(obstacle: Obstacle, spacing: float) -> float:
    """Growth of the surface that makes an obstacle two nodes thick [m]."""
    own = obstacle.span(obstacle.attitude.T)
    return max(0.0, spacing - 0.5 * float((own[1] - own[0]).min()))


def _write(nodes: Nodes, field: GridField, edit: _Edit) -> None:
    """Change nodes of a dense grid."""
    lower, spacing = field.box.lower.double().numpy(), field.spacing.double().numpy()
    for x in range(int(edit.region.first[0]), int(edit.region.end[0])):  # a layer at a time, for its memory
        some = _Region(np.array([x, *edit.region.first[1:]]), np.array([x + 1, *edit.region.end[1:]]))
        axes = [np.arange(low, high) for low, high in zip(some.first, some.end, strict=True)]
        index = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
        part = nodes.values[some.slices].reshape(-1, 4)
        states = None if nodes.states is None else nodes.states[some.slices].reshape(-1)
        written = edit.change(Nodes(part, states), lower + index * spacing)
        shape = tuple(len(axis) for axis in axes)
        nodes.values[some.slices] = written.values.reshape(*shape, 4)
        if nodes.states is not None and written.states is not None:
            nodes.states[some.slices] = written.states.reshape(shape)


def _merge(field: GridField, obstacle: Obstacle, nodes: Nodes, points: Points) -> Nodes:
    """Values (n, 4) and states (n) of nodes with a solid obstacle in them."""
    voxel = field.resolution
    distance = obstacle.signed_distance(points) - _thickening(obstacle, voxel)
    share = torch.from_numpy(distance / voxel)
    raw = (raw_of(_SLOPE * math.log(2) / voxel) - _SLOPE * share).clamp(EMPTY_RAW, _DENSEST).to(nodes.values)
    denser = (raw > nodes.values[:, 0]) & (share < _REACH)
    values = nodes.values.clone()
    values[:, 0] = torch.where(denser, raw, values[:, 0])
    painted = denser & (share < _PAINTED)
    values[painted, 1:] = torch.tensor(obstacle.color, dtype=values.dtype)
    if nodes.states is None:
        return Nodes(values, None)
    near = (share <= 0) | (denser & (share < 1) & (nodes.states == Occupancy.FREE))
    return Nodes(values, torch.where(near, int(Occupancy.SOLID), nodes.states).to(torch.uint8))


def _in_bricks(field: BrickField, obstacles: ObstacleSet) -> BrickField:
    """Write into copies of the bricks that obstacles come near to, which may be shared by many blocks."""
    slots, added = field.slots.clone(), dict[tuple[int, int, int], Nodes]()
    corner = np.stack(np.meshgrid(*[np.arange(NODES)] * 3, indexing="ij"), -1).reshape(-1, 3)
    lower, spacing = field.box.lower.double().numpy(), field.spacing.double().numpy()
    edits = _edits(field, obstacles.obstacles)
    evidence = states_of(field) if any(edit.cuts for edit in edits) else field.evidence
    for edit in edits:
        for block in _blocks(field, edit.region):
            slot = int(field.slots[block])
            known = added.get(block)
            if known is None:
                states = None if evidence is None else evidence[slot].reshape(-1)
                known = Nodes(field.values[slot].reshape(-1, 4), states)
            added[block] = edit.change(known, lower + (np.array(block) * CELLS + corner) * spacing)
    brick = (NODES, NODES, NODES)
    for number, block in enumerate(added):
        slots[block] = len(field.values) + number
    values = torch.cat([field.values, *(nodes.values.reshape(1, *brick, 4) for nodes in added.values())])
    if evidence is not None:
        more = [nodes.states.reshape(1, *brick) for nodes in added.values() if nodes.states is not None]
        evidence = torch.cat([evidence, *more])
    return replace(field, values=values, slots=slots, evidence=evidence)


def _blocks(field: BrickField, region: _Region) -> Iterator[tuple[int, int, int]]:
    """Blocks of which a node is in a region; the nodes on a border belong to several."""
    first = (region.first - 1).clip(0) // CELLS
    end = np.minimum(region.end // CELLS + 1, field.slots.shape)
    for block in np.ndindex(*(end - first).clip(0)):
        x, y, z = (int(at) for at in first + block)
        yield x, y, z


def place_in_scene(scene: "Scene", obstacles: ObstacleSet) -> "Scene":
    """Return the ground truth with obstacles in it, where they are at time 0: in pictures and as solids."""
    import trimesh

    from nerfnav.world import Paint, paint_of

    scene = move_parts(scene, tuple(each for each in obstacles.obstacles if isinstance(each.shape, CutOut)))
    added = [each for each in obstacles.obstacles if not isinstance(each.shape, CutOut)]
    meshes = [obstacle.mesh() for obstacle in added]
    whole = [scene.mesh, *meshes]
    counts = np.cumsum([0, *(len(mesh.vertices) for mesh in whole)])
    faces = [np.asarray(mesh.faces) + first for mesh, first in zip(whole, counts[:-1], strict=True)]
    vertices = np.concatenate([np.asarray(mesh.vertices) for mesh in whole])
    paint = scene.paint or paint_of(scene.mesh)
    tints = [
        np.tile(np.rint(255 * np.array(obstacle.color)), (len(mesh.faces), 3, 1))
        for obstacle, mesh in zip(added, meshes, strict=True)
    ]
    count = sum(len(mesh.faces) for mesh in meshes)
    paint = Paint(
        paint.images,
        np.concatenate([paint.image_of_face, np.full(count, -1, np.int32)]),
        np.concatenate([paint.uv, np.zeros((count, 3, 2), np.float32)]),
        np.concatenate([paint.tint, *tints]).astype(np.uint8),
    )
    mesh = trimesh.Trimesh(vertices, np.concatenate(faces), process=False)
    return replace(scene, mesh=mesh, paint=paint, solids=(*scene.solids, *meshes))
