"""Robots with thin parts, an exact place, and distances between the two."""

from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import scipy
import torch
import trimesh

from nerfnav.field.core.occupancy import SOLID_DENSITY, raw_of
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav.robots.body import Body
from nerfnav.robots.body_file import BodyFile, Cylinder, body_of
from nerfnav.robots.state import Motion, RigidState
from nerfnav.robots.surface import divide_until, longest_edges

FIVE = [(0.16 * x, 0.16 * y, 0.0, 0.03) for x, y in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))]
"""Five balls of 3 cm, 16 cm apart."""
SHAPES = ("spheres", "rod", "pole", "plate", "cross")


@cache
def thin_body(shape: str) -> Body:
    """One of the shapes, as a robot's file would have it."""
    entries = {
        "spheres": BodyFile(spheres=FIVE),
        "rod": BodyFile(box=(1.0, 0.01, 0.01)),
        "pole": BodyFile(cylinder=Cylinder(0.005, 1.0)),
        "plate": BodyFile(box=(0.4, 0.4, 0.01)),
    }
    return body_of(entries[shape], Path())[0] if shape in entries else Body.from_mesh(cross(), 0.08)


def cross() -> trimesh.Trimesh:
    """Two arms of 0.5 m, 1 cm wide and high."""
    arms = [trimesh.creation.box(edges) for edges in ((0.5, 0.01, 0.01), (0.01, 0.5, 0.01))]
    return trimesh.boolean.union(arms)


@dataclass(frozen=True)
class Obstacles:
    """A ball and a box, as signed distances, and as a field whose level set they are exactly."""

    ball: tuple[float, float, float, float] = (-0.25, 0.1, 0.0, 0.12)
    lower: tuple[float, float, float] = (0.2, -0.2, -0.3)
    upper: tuple[float, float, float] = (0.3, 0.1, 0.3)
    side: float = 1.6
    voxel: float = 0.01

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Signed distance from the nearest of them [m]."""
        lower, upper = np.array(self.lower), np.array(self.upper)
        away = np.abs(points - 0.5 * (lower + upper)) - 0.5 * (upper - lower)
        to_box = np.linalg.norm(away.clip(0), axis=-1) + away.max(-1).clip(max=0)
        return np.minimum(to_box, np.linalg.norm(points - self.ball[:3], axis=-1) - self.ball[3])

    @cached_property
    def field(self) -> VoxelField:
        """Raw densities that grow with the depth, so that they pass the threshold of maps where the distance is 0."""
        axis = torch.linspace(-0.5 * self.side, 0.5 * self.side, round(self.side / self.voxel) + 1, dtype=torch.float64)
        nodes = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), -1).numpy()
        # beyond two voxels the density is next to nothing, as fields have it in free space
        raw = 1e-3 + raw_of(SOLID_DENSITY) - 1000 * torch.from_numpy(self.distance(nodes)).clamp(-0.05, 0.05)
        half = 0.5 * self.side
        values = torch.cat([raw[..., None].float(), torch.zeros(*raw.shape, 3)], -1)
        return VoxelField(Box.of((-half, -half, -half), (half, half, half)), values, torch.ones(3))


def dense_surface(body: Body, apart: float = 0.002) -> np.ndarray:
    """Points of the body's true surface, edges and corners included, at most `apart` [m] apart."""
    mesh = trimesh.creation.box(body.extents) if body.solid is None else body.solid
    return np.unique(divide_until(np.asarray(mesh.triangles, float), longest_edges, apart).reshape(-1, 3), axis=0)


def true_clearance(obstacles: Obstacles, body: Body, surface: np.ndarray, state: RigidState) -> float:
    """Distance of a body from the obstacles or the border [m]: of balls exactly, else of its surface's points."""
    middles, radii = surface, 0.0
    if body.balls is not None:
        balls = body.balls.double().numpy()
        middles, radii = balls[:, :3], balls[:, 3]
    world = middles @ state.rotation.double().numpy().T + state.position.double().numpy()
    border = (0.5 * obstacles.side - np.abs(world)).min(-1)
    return max(0.0, float((np.minimum(obstacles.distance(world), border) - radii).min()))


def random_poses(count: int, seed: int, reach: float = 0.45) -> RigidState:
    """Poses of any attitude around the middle of the place."""
    turn = torch.from_numpy(scipy.spatial.transform.Rotation.random(count, random_state=seed).as_rotvec()).float()
    place = reach * (2 * torch.rand(count, 3, generator=torch.Generator().manual_seed(seed)) - 1)
    return RigidState(place, torch.zeros(count, 3), so3.exp(turn), torch.zeros(count, 3))


def standing(state: RigidState) -> Motion:
    """A motion that stays at one state."""
    return Motion(RigidState.stack([state, state]), torch.zeros(1, 4), 0.1)
