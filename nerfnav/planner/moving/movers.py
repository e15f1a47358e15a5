"""Movers: announced obstacles that move, as boxes at the times of a plan, and the distance of a body from them.

A box around each obstacle along its own axes, enlarged by the upright cylinder around a robot, makes the robot a point:
where the point is outside, the robot touches nothing. Else the signed distance of the body's points from the obstacle
itself decides.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool, Float

from nerfnav.obstacles import Obstacle
from nerfnav.planner.kernels.movers import box_gaps, cover
from nerfnav.robots import Body, RigidState, divide_steps

Points = Float[np.ndarray, "n 3"]
_APART = 0.03
"""Largest way of robot and movers together between two times at which they are compared [m]."""
_MOST_PARTS = 40
"""Times in a step at which they are compared, at most."""


@dataclass(frozen=True)
class MoverBoxes:
    """Boxes around movers, enlarged by a robot."""

    centers: Float[np.ndarray, "n m 3"]
    """Middles at each time [m]."""
    axes: Float[np.ndarray, "m 3 3"]
    """Axes of each box in the world, as rows."""
    halves: Float[np.ndarray, "m 3"]
    """Half edges [m]."""

    def gaps(self, points: Points) -> Float[np.ndarray, "n m"]:
        """Signed distances of points, one for each time, from the boxes [m]."""
        found = np.empty((len(points), len(self.halves)))
        box_gaps(np.ascontiguousarray(points, float), self.centers, self.axes, self.halves, found)
        return found

    def cover(self, points: Float[np.ndarray, "s 3"], margin: float) -> Bool[np.ndarray, "n s"]:
        """Mark the points that are nearer to a box than a margin [m], at each time."""
        covered = np.empty((len(self.centers), len(points)), bool)
        cover(np.ascontiguousarray(points, float), self.centers, self.axes, self.halves, margin, covered)
        return covered


@dataclass(frozen=True, eq=False)
class Movers:
    """Obstacles whose motion is announced."""

    obstacles: tuple[Obstacle, ...]
    """Obstacles that move; their time is that of the flight."""

    @property
    def speed_bound(self) -> float:
        """Speed that none of them exceeds [m/s]."""
        return max(obstacle.motion.speed_bound for obstacle in self.obstacles)

    def beside(self, others: "Movers | None") -> "Movers":
        """Return these and others."""
        return self if others is None else Movers((*self.obstacles, *others.obstacles))

    @cached_property
    def _spans(self) -> Float[np.ndarray, "m 2 3"]:
        return np.array([obstacle.span(obstacle.attitude.T) for obstacle in self.obstacles])

    @cached_property
    def _axes(self) -> Float[np.ndarray, "m 3 3"]:
        return np.ascontiguousarray([obstacle.attitude.T for obstacle in self.obstacles])

    def boxes(self, times: Sequence[float] | Float[np.ndarray, " n"], body: Body) -> MoverBoxes:
        """Boxes at times of the flight [s], enlarged by a level body with any heading."""
        clock, axes = np.asarray(times, float), self._axes
        middles = np.einsum("mij,mi->mj", axes, self._spans.mean(1))
        places = np.stack([obstacle.place(clock) for obstacle in self.obstacles], 1)
        points = body.points_body.double().cpu().numpy()
        around, tall = np.hypot(points[:, 0], points[:, 1]).max(), np.abs(points[:, 2]).max()
        grown = around * np.hypot(axes[..., 0], axes[..., 1]) + tall * np.abs(axes[..., 2])
        return MoverBoxes(places + middles, axes, 0.5 * (self._spans[:, 1] - self._spans[:, 0]) + grown)

    def least_gaps(self, states: RigidState, dt: float, body: Body, time: float) -> Float[np.ndarray, " steps"]:
        """Least distance of a body from them in each step of a motion [m], negative where it touches one.

        The states, batch shape (steps + 1,), are `dt` [s] apart, from a time of the flight [s] on; what is not finite
        touches nothing. A distance is that of the point from the enlarged boxes where it is outside of them.
        """
        steps = len(states.position) - 1
        if not (states.position.isfinite().all() and states.rotation.isfinite().all()):
            return np.full(steps, np.inf)
        fastest = float(states.position.diff(dim=0).norm(dim=-1).max()) + self.speed_bound * dt
        parts = min(_MOST_PARTS, max(1, int(np.ceil(fastest / _APART))))
        states = states.map(lambda part: part.detach().double())
        times = time + dt / parts * np.arange(steps * parts + 1)
        middles, at = states.position.cpu().numpy(), np.arange(steps * parts + 1) / parts
        places = np.stack([np.interp(at, np.arange(steps + 1), axis) for axis in middles.T], -1)
        gaps = self.boxes(times, body).gaps(places)
        if (gaps <= 0).any():  # attitudes count where a box is entered alone
            self._measure_entered(gaps, divide_steps(states, parts), times, body)
        within = np.lib.stride_tricks.sliding_window_view(gaps.min(-1), parts + 1)[::parts]
        return within.min(-1)

    def _measure_entered(
        self, gaps: Float[np.ndarray, "n m"], poses: RigidState, times: Float[np.ndarray, " n"], body: Body
    ) -> None:
        """Replace the gaps of boxes that are entered by the distance of the body from the mover itself [m]."""
        for index, obstacle in enumerate(self.obstacles):
            near = np.flatnonzero(gaps[:, index] <= 0)
            if len(near):
                points = body.points_at(poses[torch.from_numpy(near)]).double().cpu().numpy()
                own = (points - obstacle.place(times[near])[:, None]) @ obstacle.attitude
                distance = obstacle.shape.signed_distance(own.reshape(-1, 3)).reshape(points.shape[:2])
                gaps[near, index] = distance.min(-1)
