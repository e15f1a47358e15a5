"""Cut-out: a part of the field within a volume, which can be moved; its density and colours come along.

    cut     nodes in the volume become empty and unproven, but for those that were proven free
    paste   where the moved volume is, the denser of what is there and of the part counts, with its colours;
            nodes are solid or unproven as the nearest node of the part is

So a part that is pasted where it was gives the field of before; what it leaves behind was never seen.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import Field, GridField, Occupancy, density_at
from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.field.models.bricks import CELLS, BrickField
from nerfnav.obstacles.motions import Vector
from nerfnav.obstacles.obstacle import Obstacle
from nerfnav.obstacles.shapes import BoxShape, Distances, Points, Sphere

if TYPE_CHECKING:  # slow to import
    import trimesh

    from nerfnav.world import Scene

_SAMPLES, _THIN = 24, 1.0
"""Samples of a volume along each axis, and a density that is next to nothing [1/m]."""


@dataclass(frozen=True)
class CutOut:
    """Part of the field within a volume; as a solid, the volume itself, which may hold air beside what was cut out."""

    volume: BoxShape | Sphere
    """Volume around its own origin."""
    position: Vector
    """Place of its origin where the part was cut out [m]."""
    rotation: Vector = (0.0, 0.0, 0.0)
    """Roll, pitch and yaw there [rad]."""

    @property
    def source(self) -> Obstacle:
        """Return the volume where the part was cut out."""
        return Obstacle("part", self.volume, self.position, self.rotation)

    def signed_distance(self, points: Points) -> Distances:
        """Distance of points from the surface of the volume [m], negative inside."""
        return self.volume.signed_distance(points)

    def support(self, directions: Points) -> Distances:
        """Largest projection onto each direction [m]."""
        return self.volume.support(directions)

    def mesh(self) -> "trimesh.Trimesh":
        """Closed mesh of the volume."""
        return self.volume.mesh()


@dataclass(frozen=True)
class Nodes:
    """Nodes of a grid with their states."""

    values: Float[Tensor, "*nodes 4"]
    """Raw density and colour."""
    states: Tensor | None
    """Occupancy; None where it was never determined."""


def cut(shape: CutOut, nodes: Nodes, points: Points) -> Nodes:
    """Take what is in the volume out of nodes (n) at `points` [m]; what it leaves behind is unproven."""
    assert nodes.states is not None, "fields with cut-outs have states"
    left = torch.from_numpy(shape.source.signed_distance(points) <= 0) & (nodes.states != Occupancy.FREE)
    values, states = nodes.values.clone(), nodes.states.clone()
    values[left, 0], states[left] = EMPTY_RAW, int(Occupancy.UNPROVEN)
    return Nodes(values, states)


def paste(field: GridField, obstacle: Obstacle, nodes: Nodes, points: Points) -> Nodes:
    """Put the part of a `field` into nodes (n) at `points` [m], where the obstacle is at time 0."""
    shape = obstacle.shape
    assert isinstance(shape, CutOut) and nodes.states is not None
    values, states = nodes.values.clone(), nodes.states.clone()
    inside = torch.from_numpy(obstacle.signed_distance(points) <= 0)
    if not inside.any():
        return nodes
    own = (points[inside.numpy()] - np.array(obstacle.position)) @ obstacle.attitude
    there = torch.from_numpy(own @ shape.source.attitude.T + np.array(shape.position))
    part = field.between_nodes(there.to(field.values), slice(0, 4)).to(values)
    known = field.box.contains(there.to(field.box.lower))
    denser = known & (part[:, 0] > values[inside, 0])
    values[inside] = torch.where(denser[:, None], part, values[inside])
    came = _states_at(field, there)
    taken = known & ((came == Occupancy.SOLID) | ((came == Occupancy.UNPROVEN) & (states[inside] == Occupancy.FREE)))
    states[inside] = torch.where(taken, came, states[inside])
    return Nodes(values, states)


def _states_at(field: GridField, points: Float[Tensor, "n 3"]) -> Tensor:
    """States of the nodes that are nearest to points [m]."""
    at = ((points - field.box.lower.double()) / field.spacing.double()).round().long()
    x, y, z = torch.minimum(at.clamp_min(0), torch.tensor(field.shape) - 1).unbind(-1)
    if isinstance(field, BrickField):
        block = field.slots[x // CELLS, y // CELLS, z // CELLS].long()
        return states_of(field)[block, x % CELLS, y % CELLS, z % CELLS]
    return states_of(field)[x, y, z]


def states_of(field: GridField) -> Tensor:
    """Occupancy of the nodes that a field keeps; as it says, where that was never determined."""
    if field.evidence is not None:
        return field.evidence
    raw = field.values[..., 0]
    return torch.where(raw > EMPTY_RAW, int(Occupancy.SOLID), int(Occupancy.FREE)).to(torch.uint8)


def require_part(field: Field, obstacle: Obstacle) -> None:
    """Raise InvalidInputError for a cut-out whose volume holds nothing of the field."""
    shape = obstacle.shape
    assert isinstance(shape, CutOut)
    steps = [np.linspace(low, high, _SAMPLES) for low, high in shape.source.span(np.eye(3)).T]
    points = np.stack(np.meshgrid(*steps, indexing="ij"), -1).reshape(-1, 3) + np.array(shape.position)
    points = points[shape.source.signed_distance(points) <= 0]
    if not (density_at(field, points) > _THIN).any():
        raise InvalidInputError(f"the volume of {obstacle.name!r} holds nothing of the place: move it onto something")


def move_parts(scene: "Scene", cut_outs: tuple[Obstacle, ...]) -> "Scene":
    """Move the parts of a ground truth within the volumes of cut-outs to where these are at time 0.

    Solids are cut at the surface of a volume, faces of the visible mesh go with their middles.
    """
    for obstacle in cut_outs:
        shape = obstacle.shape
        assert isinstance(shape, CutOut)
        scene = _move_part(scene, shape, obstacle)
    return scene


def _move_part(scene: "Scene", shape: CutOut, obstacle: Obstacle) -> "Scene":
    import trimesh

    from nerfnav.world import Paint, paint_of

    turn = obstacle.attitude @ shape.source.attitude.T
    shift = np.array(obstacle.position) - turn @ np.array(shape.position)
    volume, solids = shape.source.mesh(), list[trimesh.Trimesh]()
    for solid in scene.solids:
        if (solid.bounds[0] > volume.bounds[1]).any() or (solid.bounds[1] < volume.bounds[0]).any():
            solids.append(solid)
            continue
        rest = trimesh.boolean.difference([solid, volume], engine="manifold")
        part = trimesh.boolean.intersection([solid, volume], engine="manifold")
        part.vertices = np.asarray(part.vertices) @ turn.T + shift
        solids.extend(piece for piece in (rest, part) if len(piece.faces))
    mesh, paint = scene.mesh, scene.paint or paint_of(scene.mesh)
    corners = np.asarray(mesh.triangles, float)
    inside: Bool[np.ndarray, " f"] = shape.source.signed_distance(corners.mean(1)) <= 0
    order = np.concatenate([np.flatnonzero(~inside), np.flatnonzero(inside)])
    moved = corners[inside] @ turn.T + shift
    vertices = np.concatenate([np.asarray(mesh.vertices), moved.reshape(-1, 3)])
    new = len(mesh.vertices) + np.arange(3 * len(moved)).reshape(-1, 3)
    faces = np.concatenate([np.asarray(mesh.faces)[~inside], new])
    paint = Paint(paint.images, paint.image_of_face[order], paint.uv[order], paint.tint[order])
    return replace(
        scene, mesh=trimesh.Trimesh(vertices, faces, process=False), paint=paint, solids=tuple(solids)
    )
