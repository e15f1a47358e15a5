"""Judging a flight on ground truth: whether the robot's body touches the mesh, where, and how deeply.

A motion's states are up to centimetres apart, so it is judged on poses interpolated between them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
import trimesh
from jaxtyping import Bool, Float, Int
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.robots.body import Body
from nerfnav.robots.state import RigidState
from nerfnav.world.body_volume import BodyVolume, volume_of
from nerfnav.world.scene import Scene
from nerfnav.world.solid import Solid, overlap_volume
from nerfnav.world.triangles import TriangleIndex, Triangles


@dataclass(frozen=True)
class ContactConfig:
    """How densely a motion is judged."""

    spacing: float = 0.005
    """Largest distance between neighbouring poses [m]."""
    rotation_spacing: float = 0.02
    """Largest angle between neighbouring poses [rad]."""


@dataclass(frozen=True)
class ContactReport:
    """What became of a body along a motion of n + 1 states."""

    poses: RigidState
    """The m poses that were judged."""
    touched_poses: Bool[Tensor, " m"]
    """Whether the body meets a surface or lies inside a solid at each pose."""
    overlap_m3: Float[Tensor, " m"]
    """Volume that the body shares with what is solid at each pose [m^3]."""
    touched: Bool[Tensor, " n"]
    """Whether the body touches anything between state k and state k + 1, both included."""

    @property
    def max_overlap_m3(self) -> float:
        """The deepest overlap [m^3]; 0 for a clean flight."""
        return float(self.overlap_m3.max())

    @property
    def first_touched_step(self) -> int | None:
        """Index of the first step in which the body touches anything."""
        steps = self.touched.nonzero()
        return int(steps[0, 0]) if len(steps) else None


def interpolate_poses(states: RigidState, config: ContactConfig | None = None) -> RigidState:
    """The states of a motion, batch shape (n + 1,), and enough between them: straight lines, steady turns."""
    return _interpolate(states, config or ContactConfig())[0]


def _interpolate(states: RigidState, config: ContactConfig) -> tuple[RigidState, Int[Tensor, " k"]]:
    """The dense states, and where among them the given ones stand."""
    before, after = states[:-1], states[1:]
    turn = so3.local(before.rotation, after.rotation)
    way = (after.position - before.position).norm(dim=-1)
    parts = torch.maximum(way / config.spacing, turn.norm(dim=-1) / config.rotation_spacing)
    counts = parts.ceil().clamp_min(1).long()
    segment = torch.arange(len(counts)).repeat_interleave(counts)
    starts = torch.cat([torch.zeros(1, dtype=torch.long), counts.cumsum(0)])
    share = ((torch.arange(len(segment)) - starts[segment]) / counts[segment])[:, None].to(way)

    def blend(first: Tensor, second: Tensor) -> Tensor:
        return first[segment] + share * (second - first)[segment]

    between = RigidState(
        blend(before.position, after.position),
        blend(before.velocity, after.velocity),
        so3.retract(before.rotation[segment], share * turn[segment]),
        blend(before.body_rate, after.body_rate),
    )
    return RigidState.cat([between, states[-1:]]), starts


class Ground:
    """All solids and sheets of a scene, ready to be asked."""

    def __init__(self, scene: Scene) -> None:
        """Index the scene's triangles."""
        self._solids = [Solid(mesh) for mesh in scene.solids]
        self._sheets = TriangleIndex(_triangles(scene.sheets))
        self._index = TriangleIndex(_triangles((*scene.solids, *scene.sheets)))

    def touches(self, body: Body, states: RigidState) -> Bool[Tensor, " n"]:
        """Whether the body touches a surface or lies inside a solid at each state, batch shape (n,)."""
        rotations, centers = _numpy(states)
        volume = volume_of(body)
        touched = self._index.touched(rotations, centers, volume.half)
        for solid in self._solids:
            free = np.flatnonzero(~touched)
            touched[free] = solid.contains(centers[free])
        if not volume.is_box:  # what touches the box around it need not touch the body
            for index in np.flatnonzero(touched):
                touched[index] = self._overlap(volume, rotations[index], centers[index]) > 0
        return torch.from_numpy(touched)

    def overlaps(self, body: Body, states: RigidState) -> Float[Tensor, " n"]:
        """Volume [m^3] that the body shares with the solids at each state, batch shape (n,).

        Sheets have no volume: of a body that they go through, they count the cells (an eighth of an edge) they cross.
        """
        volume = volume_of(body)
        volumes = [self._overlap(volume, rotation, center) for rotation, center in zip(*_numpy(states), strict=True)]
        return torch.tensor(volumes, dtype=torch.float64)

    def _overlap(self, body: BodyVolume, rotation: np.ndarray, center: np.ndarray) -> float:
        shared = overlap_volume(self._solids, body, rotation, center)
        crossed = body.crossed(self._sheets, rotation, center)
        middles = body.middles[crossed] @ rotation.T + center
        for solid in self._solids if crossed.any() else ():  # what these hold is counted already
            middles = middles[~solid.contains(middles)]
        return shared + len(middles) * body.cell_volume


def _triangles(meshes: tuple[trimesh.Trimesh, ...]) -> Triangles:
    return np.concatenate([np.zeros((0, 3, 3)), *(np.asarray(mesh.triangles) for mesh in meshes)])


def _numpy(states: RigidState) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (n, 3, 3) and positions (n, 3) in double precision."""
    rotations, centers = (x.detach().cpu().double().numpy() for x in (states.rotation, states.position))
    return rotations, centers


@lru_cache(maxsize=4)
def ground(scene: Scene) -> Ground:
    """The scene's solids, indexed once."""
    return Ground(scene)


def judge(scene: Scene, body: Body, states: RigidState, config: ContactConfig | None = None) -> ContactReport:
    """Follow a body through the states of a motion, batch shape (n + 1,), n at least 1."""
    states = states.detach()
    poses, starts = _interpolate(states, config or ContactConfig())
    touched = ground(scene).touches(body, poses)
    overlap = torch.zeros(len(touched), dtype=torch.float64)
    overlap[touched] = ground(scene).overlaps(body, poses[touched])
    so_far = torch.cat([torch.zeros(1, dtype=torch.long), touched.long().cumsum(0)])
    return ContactReport(poses, touched, overlap, so_far[starts[1:] + 1] > so_far[starts[:-1]])


def contact_check(
    scene: Scene, body: Body, config: ContactConfig | None = None
) -> Callable[[RigidState, RigidState], bool]:
    """What a simulator asks: does the body touch anything on the way from one state to the next?"""
    solids, config = ground(scene), config or ContactConfig()

    def touched(before: RigidState, after: RigidState) -> bool:
        between = interpolate_poses(RigidState.stack([before.detach(), after.detach()]), config)
        return bool(solids.touches(body, between).any())

    return touched
