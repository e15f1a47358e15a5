"""Contact check: judge on ground truth whether, where and how deeply a robot's body touches the mesh along a motion.

A motion's states are up to centimetres apart, so it is judged on poses interpolated between them: straight lines,
steady turns.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.robots import Body, RigidState, interpolate_poses
from nerfnav.world.collision import Ground, ground
from nerfnav.world.scene import Scene


@dataclass(frozen=True)
class ContactConfig:
    """Spacing of the poses at which a motion is judged."""

    spacing: float = 0.005
    """Largest distance between neighbouring poses [m]."""
    rotation_spacing: float = 0.02
    """Largest angle between neighbouring poses [rad]."""


@dataclass(frozen=True)
class ContactReport:
    """Contacts of a body along a motion of n + 1 states."""

    poses: RigidState
    """The m poses that were judged."""
    touched_poses: Bool[Tensor, " m"]
    """Poses at which the body meets a surface or lies inside a solid."""
    overlap_m3: Float[Tensor, " m"]
    """Volume that the body shares with solids at each pose [m^3]."""
    touched: Bool[Tensor, " n"]
    """Steps in which the body touches anything, between state k and state k + 1, both included."""

    @property
    def max_overlap_m3(self) -> float:
        """The deepest overlap [m^3]; 0 for a clean flight."""
        return float(self.overlap_m3.max())

    @property
    def first_touched_step(self) -> int | None:
        """Index of the first step in which the body touches anything."""
        steps = self.touched.nonzero()
        return int(steps[0, 0]) if len(steps) else None


def judge(scene: Scene, body: Body, states: RigidState, config: ContactConfig | None = None) -> ContactReport:
    """Follow a body through the states of a motion, batch shape (n + 1,), n at least 1.

    Raises InvalidInputError for states that are not finite, which have no pose to judge.
    """
    states = states.detach()
    wrong = ~(states.position.isfinite().all(-1) & states.rotation.isfinite().all(-1).all(-1))
    if wrong.any():
        raise InvalidInputError(
            f"a motion is judged on states of finite numbers, and {int(wrong.sum())} of {len(wrong)} are not: the "
            f"first is state {int(wrong.nonzero()[0, 0])}"
        )
    config = config or ContactConfig()
    poses, starts = interpolate_poses(states, config.spacing, config.rotation_spacing)
    touched = ground(scene).touches(body, poses)
    overlap = torch.zeros(len(touched), dtype=torch.float64)
    overlap[touched] = ground(scene).overlaps(body, poses[touched])
    so_far = torch.cat([torch.zeros(1, dtype=torch.long), touched.long().cumsum(0)])
    return ContactReport(poses, touched, overlap, so_far[starts[1:] + 1] > so_far[starts[:-1]])


def contact_check(
    scene: Scene, body: Body, config: ContactConfig | None = None
) -> Callable[[RigidState, RigidState], bool]:
    """Make the contact test of a simulator: does the body touch anything between one state and the next?

    A state that is not finite touches nothing.
    """
    solids, config = ground(scene), config or ContactConfig()

    def touched(before: RigidState, after: RigidState) -> bool:
        between = _poses_near(solids, body, before, after, config)
        return between is not None and bool(solids.touches(body, between).any())

    return touched


def level_contact_check(
    scene: Scene, body: Body, slope: float, config: ContactConfig | None = None
) -> Callable[[RigidState, RigidState], bool]:
    """Make the test of a simulator for landings: does the body, where it first touches anything between two states,
    touch only surfaces within `slope` [rad] of level?"""
    solids, config = ground(scene), config or ContactConfig()

    def is_level(before: RigidState, after: RigidState) -> bool:
        between = _poses_near(solids, body, before, after, config)
        touched = torch.zeros(0, dtype=torch.bool) if between is None else solids.touches(body, between)
        if between is None or not touched.any():
            return False
        return solids.largest_slope(body, between[int(touched.int().argmax())]) <= slope

    return is_level


def _poses_near(
    solids: Ground, body: Body, before: RigidState, after: RigidState, config: ContactConfig
) -> RigidState | None:
    """Interpolate the poses of a step that are near the ground truth; None where none is, or where one is not finite.

    A robot that is lost may be anywhere, and its path is as long as its speed makes it: only the part within the
    bounds of the ground truth, and a body's radius around, is sampled.
    """
    start, end = (state.position.detach().double() for state in (before, after))
    if not (start.isfinite().all() and end.isfinite().all() and after.rotation.isfinite().all()):
        return None
    way = end - start
    edges = torch.from_numpy(solids.bounds) + body.radius * torch.tensor([[-1.0], [1.0]]).double()
    shares = (edges - start) / torch.where(way == 0, torch.full_like(way, 1e-300), way)
    first, last = shares.amin(0).max().clamp_min(0).item(), shares.amax(0).min().clamp_max(1).item()
    if not first <= last:
        return None
    ends = RigidState.stack([before.detach(), after.detach()])
    if (first, last) != (0.0, 1.0):
        turn, share = so3.local(before.rotation, after.rotation), torch.tensor([first, last])[:, None]
        rotation = so3.retract(before.rotation.detach().expand(2, 3, 3), (share * turn.detach()).to(ends.rotation))
        ends = replace(ends, position=(start + share * way).to(ends.position), rotation=rotation)
    return interpolate_poses(ends, config.spacing, config.rotation_spacing)[0]
