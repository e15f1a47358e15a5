"""Robot protocol: turn flat waypoints into motion, and take a step of the dynamics.

Discrete differential flatness: a robot names its free numbers (`free`), such that any value of them gives a motion
that starts at `start`, ends at `goal` and obeys the discrete dynamics of `step`, all exactly. A planner may then
change `free` without constraints.
"""

from abc import ABC, abstractmethod
from copy import copy
from dataclasses import dataclass, replace
from functools import cache
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
    """A bound on something that a motion asks of a robot."""

    name: str
    """What is bounded: a key of `Robot.demands`."""
    unit: str
    """Its unit."""
    lower: float | None = None
    """Smallest value allowed."""
    upper: float | None = None
    """Largest value allowed."""

CAMERA = Camera.from_fov(200, 200, 90)
"""What robots see with unless told otherwise: as wide as the bundled fields' own photographs."""
_NO_PART_OF_THE_MAP = frozenset(
    ("__init__", "hold", "steer", "encode", "free_scales", "free_headings", "check_ends", "settled", "with_body",
     "body_with_room", "with_camera", "source")
)  # fmt: skip
"""What a robot may do in its own way, and still be moved by its parent's compiled map."""


class Robot(ABC):
    """A body that moves."""

    name: str
    """What users call it, as in `--robot`."""
    body: Body
    """Its shape."""
    action_names: tuple[str, ...]
    """Name and unit of each number of an action, e.g. "thrust_n"."""
    action_weights: tuple[float, ...]
    """Diagonal of Gamma in the control cost u' Gamma u, one for each number of an action [1 / unit^2]."""
    minimum_steps: int
    """Fewest steps in which a motion between two full states exists."""
    planar: bool = False
    """Whether it stays at the height of its start, level."""
    bounds: tuple[Limit, ...] = ()
    """What it can do at most."""
    acceleration: float | None = None
    """For which it is given time where nobody says how long a flight may take [m/s^2]; None: its speed alone counts."""
    camera: Camera = CAMERA
    """What it sees with."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""
    file: Path | None = None
    """What describes it; None where its class alone does."""

    @property
    def source(self) -> str:
        """What `nerfnav.robots.load` makes it of again: its file, or its name."""
        return str(self.file or self.name)

    def with_body(self, body: Body) -> "Robot":
        """The same robot, mass and inertia included, in another shape."""
        other = copy(self)
        other.body = body
        return other

    def with_camera(self, camera: Camera, mount: Pose) -> "Robot":
        """The same robot with another camera at `mount` T_body_camera."""
        other = copy(self)
        other.camera, other.mount = camera, mount
        return other

    def require_planned(self) -> None:
        """Raise InvalidInputError for what does not move by itself: it is tracked, and never planned for."""
        return

    def body_with_room(self, margin: float) -> Body:
        """The body with so much room around it [m]; a robot on the ground needs none above what it stands on."""
        return self.body.grown(margin, upright=not self.planar)

    @abstractmethod
    def step(self, state: RigidState, action: Float[Tensor, "*batch a"], dt: float) -> RigidState:
        """The state after `dt` [s] under an action: f(x, u), differentiable."""

    @abstractmethod
    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> Float[Tensor, " a"]:
        """The action of `dt` [s] that brings the robot nearer to rest; repeated, it comes to rest and stays so.

        With `turn` [rad/s] it looks around, and turns on the spot. It asks nothing of the position: it is what a robot
        can do that does not know where it is.
        """

    @abstractmethod
    def motion(
        self, free: Float[Tensor, "*batch k"], start: RigidState, goal: RigidState, steps: int, dt: float
    ) -> Motion:
        """The motion over `steps` steps of `dt` [s] that the free numbers stand for, from `start` to `goal`."""

    @abstractmethod
    def encode(
        self, waypoints: Float[Tensor, "times 4"], start: RigidState, goal: RigidState, dt: float
    ) -> Float[Tensor, " k"]:
        """Free numbers whose motion follows waypoints (x, y, z [m], yaw [rad]), one for each time step.

        The first and last waypoint are start and goal; the ends' exactness wins where the waypoints disagree.
        """

    def flat_map(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> FlatMap:
        """`motion` and `limits` between two states over `steps` steps of `dt` [s], as a fast function with an adjoint.

        The compiled one where there is one; by autograd for all others, and for a robot that inherits a compiled map
        but moves otherwise than the parent for which it was compiled.
        """
        compiled = self.compiled_map(start, goal, steps, dt) if keeps_compiled_map(type(self)) else None
        return TorchFlatMap(self, start, goal, steps, dt) if compiled is None else compiled

    def compiled_map(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> FlatMap | None:
        """The twin of `motion` and `limits` in compiled kernels; None where there is none. Asked by `flat_map`."""
        return None

    def roll_out_positions(
        self, start: RigidState, actions: Float[Tensor, "n a"], dt: float
    ) -> Float[Tensor, "times 3"]:
        """Positions [m] of a robot that takes actions of `dt` [s] whatever happens, the start included."""
        compiled = self.compiled_roll_out(start, actions, dt) if keeps_compiled_map(type(self)) else None
        if compiled is not None:
            return compiled
        states = [start]
        for action in actions:
            states.append(self.step(states[-1], action, dt))
        return RigidState.stack(states).position

    def compiled_roll_out(
        self, start: RigidState, actions: Float[Tensor, "n a"], dt: float
    ) -> Float[Tensor, "times 3"] | None:
        """The same by the twin of `step` in compiled kernels; None where there is none. Asked by
        `roll_out_positions`."""
        return None

    def held(self, start: RigidState, wanted: Float[Tensor, "n 3"], dt: float, rest: float) -> Motion:
        """What comes of `hold` for up to n steps of `dt` [s], each of which brakes to a wanted velocity [m/s].

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
        """The same by compiled twins of `hold` and `step`; None where there are none. Asked by `held`."""
        return None

    def demands(self, motion: Motion) -> dict[str, Float[Tensor, "*batch times"]]:
        """What a motion asks of each of the `bounds`, over time."""
        return {}

    def check_ends(self, start: RigidState, goal: RigidState) -> None:
        """Raise InvalidInputError, in one sentence, for ends that no motion of this robot can join (default: any)."""
        return

    def settled(self, state: RigidState, before: RigidState) -> RigidState:
        """The nearest state that the robot can be in after `before`, wherever noise or an estimate puts it.

        Any state by default.
        """
        return state

    def limits(self, motion: Motion) -> Float[Tensor, "*batch"]:
        """How far a motion strays to where it is not well defined; 0 for robots that have no such place.

        A smooth penalty without units, summed over the steps; planners weigh it and add it to their cost.
        """
        return motion.actions.new_zeros(motion.actions.shape[:-2])

    def most(self, name: str) -> float | None:
        """The upper bound of that name, such as "speed"; None where there is none."""
        return next((bound.upper for bound in self.bounds if bound.name == name), None)

    def free_scales(self, free: Float[Tensor, " k"]) -> Float[Tensor, " k"]:
        """By how much each of the free numbers may change before the motion is quite another one; 1 by default."""
        return torch.ones_like(free)

    def free_headings(self, count: int) -> slice:
        """Which of so many free numbers turn the robot and do not move it; none by default."""
        return slice(count, count)


@cache
def keeps_compiled_map(robot: type[Robot]) -> bool:
    """Whether a class moves as the class does that wrote the `compiled_map` which it has.

    It does not when it, or a class between the two, overrides a method that the compiled twin stands for.
    """
    writer = next(kind for kind in robot.__mro__ if "compiled_map" in vars(kind))
    kinds = [kind for kind in writer.__mro__ if issubclass(kind, Robot)]
    stands_for = {name for kind in kinds for name, part in vars(kind).items() if _is_method(part)}
    nearer = robot.__mro__[: robot.__mro__.index(writer)]
    return not any(stands_for & vars(kind).keys() - _NO_PART_OF_THE_MAP for kind in nearer)


def _is_method(part: object) -> bool:
    return callable(part) or isinstance(part, (staticmethod, classmethod, property))
