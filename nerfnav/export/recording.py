"""What is exported: a plan or a flight as a table, and for richer formats the time steps and the place around them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.export.tables import Table, episode_table, motion_table
from nerfnav.geometry import so3
from nerfnav.navigation import Episode, NavigationStep
from nerfnav.robots import Motion, Robot, unwrapped


@dataclass(frozen=True)
class Recording:
    """Something that can be taken away."""

    table: Table
    """Time, states and actions; of a flight also the belief."""
    steps: tuple[NavigationStep, ...] = ()
    """Time steps of a flight; empty for a plan."""
    title: str = ""
    """What it is, for people."""
    extents: tuple[float, float, float] = (0.1, 0.1, 0.04)
    """Edge lengths of the robot's body [m]."""
    surface: bytes | None = None
    """The place's surface as unlit binary glTF in world axes; None where it is not known."""

    @classmethod
    def of_plan(cls, motion: Motion, robot: Robot, title: str = "") -> "Recording":
        """A plan."""
        return cls(motion_table(motion, robot.action_names, robot.name), (), title, robot.body.extents)

    @classmethod
    def of_flight(
        cls, steps: Sequence[NavigationStep], robot: Robot, title: str = "", surface: bytes | None = None
    ) -> "Recording":
        """A flight, or the first steps of one."""
        table = episode_table(Episode.of(steps), robot.action_names, robot.name)
        return cls(table, tuple(steps), title, robot.body.extents, surface)

    def standing_in(self, surface: bytes | None) -> "Recording":
        """The same in a place with this surface."""
        return replace(self, surface=surface)

    @property
    def times(self) -> Float[Tensor, " rows"]:
        """[s], from 0."""
        return self.table.column("t")

    @property
    def position(self) -> Float[Tensor, "rows 3"]:
        """In the world, ENU [m]."""
        return self.table.block(("x", "y", "z"))

    @property
    def velocity(self) -> Float[Tensor, "rows 3"]:
        """In the world, ENU [m/s]."""
        return self.table.block(("vx", "vy", "vz"))

    @property
    def quaternion(self) -> Float[Tensor, "rows 4"]:
        """(w, x, y, z) of R_world_body; neighbours have no sign flips."""
        return self.table.block(("qw", "qx", "qy", "qz"))

    @property
    def body_rate(self) -> Float[Tensor, "rows 3"]:
        """In the body's axes, FLU [rad/s]."""
        return self.table.block(("wx", "wy", "wz"))

    @property
    def believed(self) -> Float[Tensor, "rows 7"] | None:
        """Believed position [m] and quaternion (w, x, y, z); None for a plan, which believes nothing."""
        names = tuple(f"belief_{name}" for name in ("x", "y", "z", "qw", "qx", "qy", "qz"))
        return self.table.block(names) if names[0] in self.table.columns else None

    def acceleration(self) -> Float[Tensor, "rows 3"]:
        """Change of the velocity over the step that begins at each row [m/s^2]; the last row repeats the one before.

        This is what an autopilot needs as feed-forward: constant over the step.
        """
        if len(self.times) < 2:
            return torch.zeros_like(self.velocity)
        steps = self.velocity.diff(dim=0) / self.times.diff()[:, None]
        return torch.cat([steps, steps[-1:]])

    def yaw(self) -> Float[Tensor, " rows"]:
        """Heading of the body's x axis, counter-clockwise from east [rad]; unwrapped, so that it never jumps."""
        return unwrapped(so3.yaw_of(so3.matrix_from_quaternion(self.quaternion)))


@dataclass(frozen=True)
class Exported:
    """The content of a file."""

    content: bytes
    """What is to be written."""
    info: dict[str, Any] = field(default_factory=dict)
    """What the format has to say about how well it fits, such as the error of an approximation."""
