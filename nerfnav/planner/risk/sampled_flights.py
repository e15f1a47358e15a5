"""Sampled flights: poses of a body along a plan with errors, and which of them touch something.

A body touches something where one of its points is in dense space and lies deeper in the body than three quarters
of the distance of the field's nodes. A surface is known no better than that, and free space is proven node by node:
what is dense begins in front of a surface, by 0.25, 0.5, 0.5 and 1 nodes in the median at Stonehenge, in the
playground, the church and the apartment.

On grids a kernel checks all flights (kernels/flights.py). `mark_hits_anywhere` is its twin, and serves all other
fields: it first finds the poses near anything dense.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy
import torch
from jaxtyping import Bool, Float

from nerfnav.field import Field, GridField
from nerfnav.field.core.occupancy import raw_of
from nerfnav.geometry import so3
from nerfnav.planner.kernels import flights as kernels
from nerfnav.planner.space.occupancy import dense_at
from nerfnav.planner.space.scales import Scales, scales_of
from nerfnav.robots import Body, Motion

_DEPTH = 0.75
"""Depth in the body from which a point counts, in distances of the field's nodes: of 836 flights with the true state in
four places 56 touched something, where 85 would have by 0.5, 62 by 0.75, and 45 by 1."""
_SLACK = 1e-6
"""Share of a node by which rounding may move a point of the body."""


@dataclass(frozen=True, eq=False)
class SampledFlights:
    """Flights along one plan, each with its own errors."""

    centres: Float[np.ndarray, "times n 3"]
    """Place of the body's centre at the times of the plan [m]."""
    turns: Float[np.ndarray, "times n"]
    """Error of the heading [rad]."""
    arrived: Bool[np.ndarray, "times n"]
    """True where the flight has ended by then."""
    fractions: Float[np.ndarray, " k"]
    """Times between two of the plan at which the body is checked, in shares of a step."""
    rotations: Float[np.ndarray, "steps k 3 3"]
    """Planned R_world_body then."""

    @classmethod
    def of(
        cls, motion: Motion, errors: Float[np.ndarray, "times n 4"], tolerance: float, poses_per_step: int
    ) -> "SampledFlights":
        """Add errors (ahead, to the left, up [m], heading [rad]) to a plan; a flight has arrived once it is within
        `tolerance` [m] of the end of the plan."""
        position, rotation = (part.detach().double().cpu() for part in (motion.states.position, motion.states.rotation))
        fractions = (torch.arange(poses_per_step, dtype=torch.float64) + 0.5) / poses_per_step
        turn = so3.local(rotation[:-1], rotation[1:])[:, None]
        between = so3.retract(rotation[:-1, None].expand(-1, poses_per_step, 3, 3), fractions[:, None] * turn)
        level = so3.from_yaw(so3.yaw_of(rotation)).numpy()
        centres = position.numpy()[:, None] + errors[..., :3] @ level.transpose(0, 2, 1)
        arrived = np.linalg.norm(centres - position[-1].numpy(), axis=-1) < tolerance
        arrived = np.logical_or.accumulate(arrived)
        return cls(centres, errors[..., 3].astype(np.float64), arrived, fractions.numpy(), between.numpy())


@dataclass(frozen=True, eq=False)
class BodyCheck:
    """Contact check of a body in a field."""

    field: Field
    """The field as planners see it."""
    scales: Scales
    """Scales of the body in it."""
    points_body: Float[np.ndarray, "b 3"]
    """Points of the body, drawn in by the depth at which they count [m]."""

    @classmethod
    def of(cls, field: Field, body: Body) -> "BodyCheck":
        """Prepare the check; in a field without a resolution all of the body counts."""
        points = body.points_body.double().cpu().numpy()
        if isinstance(field, GridField):
            edges = np.array(body.extents)
            left = np.maximum(edges - 2 * _DEPTH * field.resolution, 0.0)
            points = points * np.divide(left, edges, out=np.ones(3), where=edges > 0)
        return cls(field, scales_of(field, body), points)

    def mark_hits(self, flights: SampledFlights) -> Bool[np.ndarray, " n"]:
        """Mark the flights that touch something before they arrive."""
        if not isinstance(self.field, GridField):
            return self.mark_hits_anywhere(flights)
        offsets = np.einsum("tkij,bj->tkbi", flights.rotations, self.points_body)
        hit, threshold = np.zeros(flights.turns.shape[1], bool), raw_of(self.scales.threshold)
        kernels.mark_hits(
            *self.field.kernel_grid, threshold, flights.centres, flights.turns, flights.arrived, flights.fractions,
            offsets, hit,
        )  # fmt: skip
        return hit

    def mark_hits_anywhere(self, flights: SampledFlights) -> Bool[np.ndarray, " n"]:
        """Mark the same in any field, by its densities alone."""
        hit, share = np.zeros(flights.turns.shape[1], bool), flights.fractions[:, None]
        for step, rotations in enumerate(flights.rotations):
            flying = (~hit & ~flights.arrived[step]).nonzero()[0]
            if len(flying) == 0:
                break
            before, after = (flights.centres[time, flying] for time in (step, step + 1))
            along = before + share[..., None] * (after - before)
            first, last = (flights.turns[time, flying] for time in (step, step + 1))
            turns = first + share * (last - first)
            near = self._candidates(along, self._half_edges(rotations, np.abs(turns).max()))
            for index, rotation in enumerate(rotations):
                left = (near[index] & ~hit[flying]).nonzero()[0]
                hit[flying[left]] = self._touches(along[index, left], turns[index, left], rotation)
        return hit

    def _candidates(self, centres: Float[np.ndarray, "k n 3"], half: Float[np.ndarray, "3"]) -> Bool[np.ndarray, "k n"]:
        """Broad phase: mark centres of a level box with half edges `half` [m] in which, or next to which, a node of a
        grid is dense; its nodes are those of a field, or as far apart as maps sample one."""
        lower, spacing = self._nodes()
        reach = np.ceil(half / spacing + _SLACK).astype(int) + 1
        at = (centres - lower) / spacing
        first = np.floor(at.min((0, 1))).astype(int) - reach
        last = np.ceil(at.max((0, 1))).astype(int) + reach
        axes = [np.arange(one, other + 1) for one, other in zip(first, last, strict=True)]
        dense = self._dense(lower + spacing * np.stack(np.meshgrid(*axes, indexing="ij"), -1)).view(np.uint8)
        for axis, count in enumerate(reach.tolist()):
            dense = scipy.ndimage.maximum_filter1d(dense, 2 * count + 1, axis)
        x, y, z = np.moveaxis(np.rint(at).astype(int) - first, -1, 0)
        return dense[x, y, z].view(bool)

    def _nodes(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """A node, and the distance of nodes along each axis [m]."""
        if isinstance(self.field, GridField):
            _, _, lower, per_meter = self.field.kernel_grid
            return lower[:3], 1 / per_meter
        return self.field.box.lower.double().cpu().numpy(), np.full(3, 0.5 * self.scales.voxel)

    def _touches(
        self, centres: Float[np.ndarray, "n 3"], turns: Float[np.ndarray, " n"], rotation: Float[np.ndarray, "3 3"]
    ) -> Bool[np.ndarray, " n"]:
        """Narrow phase: mark bodies with a point in dense space, each turned by `rotation` and then by its own error of
        the heading [rad]."""
        x, y, z = rotation @ self.points_body.T
        cosine, sine = np.cos(turns)[:, None], np.sin(turns)[:, None]
        offset = np.stack(np.broadcast_arrays(cosine * x - sine * y, sine * x + cosine * y, z), -1)
        return np.asarray(self._dense(centres[:, None] + offset).any(-1))

    def _half_edges(self, rotations: Float[np.ndarray, "k 3 3"], turn: float) -> Float[np.ndarray, "3"]:
        """Compute the half edges [m] of a level box around the body in several attitudes, turned by up to `turn`
        [rad]."""
        x, y, z = np.abs(self.points_body @ rotations.transpose(0, 2, 1)).max((0, 1))
        sine = math.sin(min(turn, 0.5 * math.pi))
        return np.array([x + sine * y, y + sine * x, z])

    def _dense(self, points: Float[np.ndarray, "*shape 3"]) -> Bool[np.ndarray, "*shape"]:
        """Mark points [m] in dense space."""
        return dense_at(self.field, torch.from_numpy(points), self.scales.threshold).numpy().view(bool)
