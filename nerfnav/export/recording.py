"""Recording: a plan, an executed path or an estimate as a table and, for richer formats, its time steps and place."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from enum import Enum
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.export.tables import Table, episode_table, estimate_table, motion_table
from nerfnav.field import Field
from nerfnav.geometry import so3
from nerfnav.navigation import Episode, EpisodeOutcome, NavigationStep
from nerfnav.planner import PiecewisePolynomial, PlanOutcome
from nerfnav.robots import Motion, Robot, unwrap_angles


class Subject(Enum):
    """Subject of a recording: one of the three trajectories of a flight; the value is that of `--of`."""

    PLAN = "plan"
    """First plan of a flight, or a plan that was not flown."""
    EXECUTED = "executed"
    """True states of the robot."""
    ESTIMATE = "estimate"
    """Means of the belief."""

    @property
    def title(self) -> str:
        """Name in a sentence."""
        return "the executed path" if self is Subject.EXECUTED else f"the {self.value}"


@dataclass(frozen=True)
class Recording:
    """Recording of a plan, an executed path or an estimate, ready for export."""

    table: Table
    """Time, states and actions; of an executed path also the belief, of an estimate its standard deviation."""
    steps: tuple[NavigationStep, ...] = ()
    """Time steps of an executed path or an estimate; empty for a plan."""
    title: str = ""
    """Title for people."""
    extents: tuple[float, float, float] = (0.1, 0.1, 0.04)
    """Edge lengths of the robot's body [m]."""
    surface: bytes | None = None
    """The place's surface as unlit binary glTF in world axes; None where it is not known."""
    robot: Robot | None = None
    """Robot of the motion; None where only its name is known."""
    field: Field | None = None
    """Field of the plan, as planners see it; None where it is not known: no vehicle's curve is judged then."""
    datum: tuple[float, float, float] | None = None
    """World's origin on Earth: latitude and longitude [deg], height above the ellipsoid or sea [m]."""
    subject: Subject = Subject.PLAN
    """Trajectory that it holds."""

    @classmethod
    def of_plan(cls, motion: Motion, robot: Robot, title: str = "", outcome: PlanOutcome | None = None) -> "Recording":
        """A plan, and how planning ended where that is known."""
        table = motion_table(motion, robot.action_names, robot.name).with_outcome(outcome)
        return cls(table, (), title, robot.body.extents, robot=robot)

    @classmethod
    def of_flight(
        cls,
        steps: Sequence[NavigationStep],
        robot: Robot,
        title: str = "",
        surface: bytes | None = None,
        subject: Subject = Subject.EXECUTED,
    ) -> "Recording":
        """One of the three trajectories of a flight, or of its first steps.

        Of flights that were stored by versions without a first plan, the plan is the one after the first belief.
        """
        if subject is Subject.PLAN:
            outcome = PlanOutcome.NO_PATH if steps[0].outcome is EpisodeOutcome.NO_PLAN else None
            return cls.of_plan(steps[0].first_plan or steps[0].plan, robot, title, outcome)
        make_table = episode_table if subject is Subject.EXECUTED else estimate_table
        table = make_table(Episode.of(steps), robot.action_names, robot.name)
        return cls(table, tuple(steps), title, robot.body.extents, surface, robot, subject=subject)

    def with_outcome(self, outcome: PlanOutcome | None) -> "Recording":
        """The same plan, and how planning ended; None: the outcome stays as it is known."""
        return replace(self, table=self.table.with_outcome(outcome))

    def with_surface(self, surface: bytes | None) -> "Recording":
        """The same in a place with this surface."""
        return replace(self, surface=surface)

    def with_field(self, field: Field | None) -> "Recording":
        """The same beside the field that it was planned in, as planners see it."""
        return replace(self, field=field)

    @property
    def outcome(self) -> str:
        """Outcome of planning or flying, in one word; empty where that is not known."""
        return str(self.table.info.get("outcome") or "")

    @property
    def times(self) -> Float[Tensor, " rows"]:
        """Times [s], from 0."""
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
    def estimated_poses(self) -> Float[Tensor, "rows 7"] | None:
        """Estimated position [m] and quaternion (w, x, y, z); None for a plan, which has no estimate."""
        if self.subject is Subject.ESTIMATE:
            return torch.cat([self.position, self.quaternion], -1)
        names = tuple(f"belief_{name}" for name in ("x", "y", "z", "qw", "qx", "qy", "qz"))
        return self.table.block(names) if names[0] in self.table.columns else None

    def yaw(self) -> Float[Tensor, " rows"]:
        """Heading of the body's x axis, counter-clockwise from east [rad]; unwrapped, so that it never jumps."""
        return unwrap_angles(so3.yaw_of(so3.matrix_from_quaternion(self.quaternion)))


@dataclass(frozen=True)
class Exported:
    """Content of an exported file, with its information."""

    content: bytes
    """Bytes of the file."""
    info: dict[str, Any] = dataclass_field(default_factory=dict)
    """Information of the format, such as the error of an approximation."""
    curve: PiecewisePolynomial | None = None
    """x, y, z [m] and yaw [rad] over time that a vehicle is to follow; None where the file moves none."""
