"""Robot: flatness map from waypoints to motion, step of the dynamics, and limits with the penalty on their excess.

Discrete differential flatness: a robot names its free numbers (`free`), such that any value of them gives a motion
that starts at `start`, ends at `goal` and obeys the discrete dynamics of `step`, all exactly. A planner may then
change `free` without constraints.
"""

from abc import ABC, abstractmethod
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import accumulate
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose
from nerfnav.robots.body import Body
from nerfnav.robots.flat_map import FlatMap, TorchFlatMap
from nerfnav.robots.state import Motion, RigidState


@dataclass(frozen=True)
class Limit:
    """Bound on a demand of a motion on a robot."""

    name: str
    """Demand that is bounded: a key of `Robot.demands`."""
    unit: str
    """Unit of the demand."""
    lower: float | None = None
    """Smallest value allowed."""
    upper: float | None = None
    """Largest value allowed."""

TYPICAL_MOVE, TYPICAL_TURN = 0.15, 0.5
"""Changes of a waypoint [m] and a heading [rad] that change a motion much."""
CAMERA = Camera.from_fov(200, 200, 90)
"""Default camera of robots: as wide as the bundled fields' own photographs."""
_NO_PART_OF_THE_MAP = frozenset(
    ("__init__", "hold", "steer", "encode", "free_scales", "free_headings", "check_ends", "settled", "with_body",
     "body_with_room", "with_camera", "source", "deceleration")
)  # fmt: skip
"""Methods that a robot may override and still use its parent's compiled map."""


class Robot(ABC):
    """Body that moves by its own dynamics."""

    name: str
    """Name, as in `--robot`."""
    body: Body
    """Its shape."""
    action_names: tuple[str, ...]
    """Name and unit of each number of an action, e.g. "thrust_n"."""
    action_weights: tuple[float, ...]
    """Diagonal of Gamma in the control cost u' Gamma u, one for each number of an action [1 / unit^2]."""
    minimum_steps: int
    """Least number of steps in which a motion between two full states exists."""
    planar: bool = False
    """True if it stays at the height of its start, level."""
    bounds: tuple[Limit, ...] = ()
    """Limits of the robot."""
    acceleration: float | None = None
    """Acceleration by which durations are estimated [m/s^2]; None: by its speed alone."""
    camera: Camera = CAMERA
    """Camera of the robot."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""
    file: Path | None = None
    """File that describes it; None where its class alone does."""

    @property
    def deceleration(self) -> float:
        """Deceleration that the robot can do in any direction [m/s^2]; 1 where neither it nor its bounds tell one."""
        return self.acceleration or self.most("acceleration") or 1.0

    @property
    def source(self) -> str:
        """Return the argument with which `nerfnav.robots.load` makes it again: its file, or its name."""
        return str(self.file or self.name)

    def with_body(self, body: Body) -> "Robot":
        """Copy the robot, mass and inertia included, with another shape."""
        other = copy(self)
        other.body = body
        return other

    def with_camera(self, camera: Camera, mount: Pose) -> "Robot":
        """Copy the robot with another camera at `mount` T_body_camera."""
        other = copy(self)
        other.camera, other.mount = camera, mount
        return other

    def require_planned(self) -> None:
        """Raise InvalidInputError for a robot that does not move by itself: it is tracked, and never planned for."""
        return

    def body_with_room(self, margin: float) -> Body:
        """Grow the body by so much room around it [m]; a robot on the ground needs none above what it stands on."""
        return self.body.grown(margin, upright=not self.planar)

    @abstractmethod
    def step(self, state: RigidState, action: Float[Tensor, "*batch a"], dt: float) -> RigidState:
        """Compute the state after `dt` [s] under an action: f(x, u), differentiable."""

    @abstractmethod
    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> Float[Tensor, " a"]:
        """Compute the action of `dt` [s] that brings the robot nearer to rest; repeated, it comes to rest and stays so.

        With `turn` [rad/s] it looks around, and turns on the spot. It does not use the position: a robot that is
        lost can still hold.
        """

    @abstractmethod
    def motion(
        self, free: Float[Tensor, "*batch k"], start: RigidState, goal: RigidState, steps: int, dt: float
    ) -> Motion:
        """Compute the motion of the free numbers over `steps` steps of `dt` [s], from `start` to `goal`."""

    @abstractmethod
    def encode(
        self, waypoints: Float[Tensor, "times 4"], start: RigidState, goal: RigidState, dt: float
    ) -> Float[Tensor, " k"]:
        """Encode as free numbers a motion that follows waypoints (x, y, z [m], yaw [rad]), one for each time step.

        The first and last waypoint are start and goal; the ends' exactness wins where the waypoints disagree.
        """

    def flat_map(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> FlatMap:
        """Make `motion` and `limits` between two states over `steps` steps of `dt` [s] a fast function with an adjoint.

        The compiled one where there is one; by autograd for all others, and for a robot that inherits a compiled map
        but moves otherwise than the parent for which it was compiled.
        """
        compiled = self.compiled_map(start, goal, steps, dt) if keeps_compiled_map(type(self)) else None
        return TorchFlatMap(self, start, goal, steps, dt) if compiled is None else compiled

    def compiled_map(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> FlatMap | None:
        """Make the twin of `motion` and `limits` in compiled kernels, for `flat_map`; None where there is none."""
        return None

    def roll_out_positions(
        self, start: RigidState, actions: Float[Tensor, "n a"], dt: float
    ) -> Float[Tensor, "times 3"]:
        """Roll out the positions [m] of a robot that takes actions of `dt` [s] in open loop, the start included."""
        compiled = self.compiled_roll_out(start, actions, dt) if keeps_compiled_map(type(self)) else None
        if compiled is not None:
            return compiled
        states = accumulate(actions, lambda state, action: self.step(state, action, dt), initial=start)
        return RigidState.stack(list(states)).position

    def compiled_roll_out(
        self, start: RigidState, actions: Float[Tensor, "n a"], dt: float
    ) -> Float[Tensor, "times 3"] | None:
        """Roll out by the twin of `step` in compiled kernels, for `roll_out_positions`; None where there is none."""
        return None

    def roll_out_hold(self, start: RigidState, wanted: Float[Tensor, "n 3"], dt: float, rest: float) -> Motion:
        """Roll out `hold` for up to n steps of `dt` [s], each of which brakes to a wanted velocity [m/s].

        It ends as soon as rest is wanted and the robot is slower than `rest` [m/s].
        """
        compiled = self.compiled_hold(start, wanted, dt, rest) if keeps_compiled_map(type(self)) else None
        if compiled is not None:
            return compiled
        states, actions = [start], []
        for velocity in wanted:
            seen = replace(states[-1], velocity=states[-1].velocity - velocity)  # to hold is to brake this to 0
            actions.append(self.hold(seen, dt))
            states.append(self.step(states[-1], actions[-1], dt))
            if not velocity.any() and states[-1].velocity.norm() < rest:
                break
        return Motion(RigidState.stack(states), torch.stack(actions), dt)

    def compiled_hold(
        self, start: RigidState, wanted: Float[Tensor, "n 3"], dt: float, rest: float
    ) -> Motion | None:
        """Roll out by compiled twins of `hold` and `step`, for `roll_out_hold`; None where there are none."""
        return None

    def demands(self, motion: Motion) -> dict[str, Float[Tensor, "*batch times"]]:
        """Compute the demands of a motion on each of the `bounds`, over time."""
        return {}

    def check_ends(self, start: RigidState, goal: RigidState) -> None:
        """Raise InvalidInputError, in one sentence, for ends that no motion of this robot can join (default: any)."""
        return

    def settled(self, state: RigidState, before: RigidState) -> RigidState:
        """Project a state to the nearest one that the robot can have after `before`, wherever noise or an estimate puts
        it.

        Any state by default.
        """
        return state

    def limits(self, motion: Motion) -> Float[Tensor, "*batch"]:
        """Penalise motions that are not well defined; 0 for robots without such motions.

        A smooth penalty without units, summed over the steps; planners weigh it and add it to their cost.
        """
        return motion.actions.new_zeros(motion.actions.shape[:-2])

    def most(self, name: str) -> float | None:
        """Return the upper bound of a name, such as "speed"; None where there is none."""
        return next((bound.upper for bound in self.bounds if bound.name == name), None)

    def free_scales(self, free: Float[Tensor, " k"]) -> Float[Tensor, " k"]:
        """Return the changes of the free numbers that change the motion much; 1 by default."""
        return torch.ones_like(free)

    def free_headings(self, count: int) -> slice:
        """Return the slice of the free numbers that turn the robot without moving it; empty by default."""
        return slice(count, count)


@cache
def keeps_compiled_map(robot: type[Robot]) -> bool:
    """Return True if a class moves as the class does that wrote its `compiled_map`.

    It does not when it, or a class between the two, overrides a method that the compiled twin stands for.
    """
    writer = next(kind for kind in robot.__mro__ if "compiled_map" in vars(kind))
    kinds = [kind for kind in writer.__mro__ if issubclass(kind, Robot)]
    stands_for = {name for kind in kinds for name, part in vars(kind).items() if _is_method(part)}
    nearer = robot.__mro__[: robot.__mro__.index(writer)]
    return not any(stands_for & vars(kind).keys() - _NO_PART_OF_THE_MAP for kind in nearer)


def _is_method(part: object) -> bool:
    return callable(part) or isinstance(part, (staticmethod, classmethod, property))


_TOLERANCE = 1e-3
"""Share of a bound by which it may be exceeded unnoticed: penalties end a little beyond."""


@dataclass(frozen=True)
class LimitUse(Limit):
    """Use of a limit by a motion."""

    least: float = field(kw_only=True)
    """Smallest value over the motion."""
    most: float = field(kw_only=True)
    """Largest value over the motion."""

    @property
    def violated(self) -> bool:
        """Return True if the motion leaves the allowed range."""
        return self.exceeds(_TOLERANCE)

    def exceeds(self, share: float) -> bool:
        """Return True if the motion leaves the allowed range by more than a share of its larger bound."""
        span = share * max(abs(self.lower or 0.0), abs(self.upper or 0.0))
        below = self.lower is not None and self.least < self.lower - span
        return below or (self.upper is not None and self.most > self.upper + span)


def limit_uses(robot: Robot, motion: Motion) -> tuple[LimitUse, ...]:
    """Compute the use of each of the robot's bounds by one motion."""
    demands = robot.demands(motion)
    return tuple(
        LimitUse(**vars(bound), least=demands[bound.name].min().item(), most=demands[bound.name].max().item())
        for bound in robot.bounds
    )


def penalty(robot: Robot, motion: Motion) -> Float[Tensor, "*batch"]:
    """Sum the squared excess over each bound, as a share of the bound, over bounds and steps; 0 within them.

    Smooth to the first derivative, so that any planner can weigh it.
    """
    total = motion.actions.new_zeros(motion.actions.shape[:-2])
    for bound in robot.bounds:
        demands = robot.demands(motion)[bound.name]
        scale = max(abs(edge) for edge in (bound.lower, bound.upper) if edge is not None)
        if bound.upper is not None:
            total = total + ((demands - bound.upper) / scale).clamp_min(0).square().sum(-1)
        if bound.lower is not None:
            total = total + ((bound.lower - demands) / scale).clamp_min(0).square().sum(-1)
    return total


def speed(motion: Motion) -> Float[Tensor, "*batch times"]:
    """Compute |v| at each time [m/s]."""
    return length(motion.states.velocity)


def length(vectors: Float[Tensor, "*batch k"]) -> Float[Tensor, "*batch"]:
    """Compute the Euclidean length with a finite derivative at zero."""
    return torch.sqrt(vectors.square().sum(-1) + 1e-16)
