"""The physical world as a simulator: the true state is that of a rigid body, moved in hundreds of steps a second.

Gyroscopes and accelerometers are ideal: what the tracking loop believes of the state is the plan's first state, which
is what the robot believed at the beginning of the time step, moved on as the robot really moves (strapdown),

    R^ = D R,   v^(t) = v^_0 + g t + D (v(t) - v_0 - g t),   D = R^_0 R_0'

and position likewise. So the error of the belief stays as it is until the next picture.
"""

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.estimator import StateNoise
from nerfnav.geometry import Pose
from nerfnav.navigation.physical.config import PhysicalConfig
from nerfnav.navigation.physical.powertrain import Powertrain
from nerfnav.navigation.physical.rigid_body import Airframe, BodyState, integrate
from nerfnav.navigation.physical.tracking import Reference, TrackingGains, Wanted, wrench_for
from nerfnav.navigation.physical.wind import Wind
from nerfnav.navigation.simulator import Simulator
from nerfnav.robots import Motion, Quadrotor, RigidState

_LOOK_APART = 0.02
"""How often the body is checked for contact [s]."""


@dataclass
class PhysicalSimulator(Simulator):
    """Where a quadrotor truly is in the physical world; `noise` is not used."""

    world: PhysicalConfig = field(default_factory=PhysicalConfig)
    """Its parameters."""
    gains: TrackingGains = field(default_factory=TrackingGains)
    """Of the loop that tracks the plan."""

    def __post_init__(self) -> None:
        """Let the robot hover. Raises InvalidInputError for other robots than quadrotors."""
        if not isinstance(self.robot, Quadrotor):
            raise InvalidInputError(
                f"the physical world is made for quadrotors, and a {self.robot.name} is none: fly it in the paper's"
            )
        self._thought = airframe(self.robot, self.world)
        self._frame = replace(self._thought, mass=self._thought.mass * (1 + self.world.mass_error))
        self._motors = Powertrain(self._thought, self.world, self.gains)
        self._wind = Wind(self.world, self.generator)
        self._put(self.state)

    def follow(self, plan: Motion, gust: StateNoise | None = None, believed: RigidState | None = None) -> bool:
        """Track the first step of a plan from where the robot believes to be (see Simulator)."""
        reference, began = Reference.of(plan, self._thought.mass), self._body
        start = reference.start if believed is None else exact(believed)
        count = max(1, round(plan.dt * self.world.control_hz))
        tick, position, velocity = plan.dt / count, reference.start.position, reference.start.velocity
        checked, touched = self.state, False
        for index in range(count):
            rotation, rate, turning = reference.attitude(index * tick)
            pull = rotation[:, 2] * reference.pull
            wanted = Wanted(position, velocity, pull, rotation, rate, turning)
            self._tick(wanted, self._believed(start, began, index * tick), tick)
            position = position + velocity * tick
            velocity = velocity + (pull + self._gravity) * tick
            if index == count - 1 or (index + 1) % max(1, round(_LOOK_APART / tick)) == 0:
                self.state = _rounded(self._body)
                touched |= self.contact is not None and self.contact(checked, self.state)
                checked = self.state
        if gust is not None:
            self._put(self.state.retract(gust.sample(self.generator)))
        return touched

    def carry(self, pose: Pose) -> None:
        """See Simulator."""
        super().carry(pose)
        self._put(self.state)

    def look(self) -> UInt8[Tensor, "height width 3"] | None:
        """The picture that arrives now, which is late; None where none does."""
        if float(torch.rand(1, generator=self.generator)) < self.world.dropped_share:
            return None
        return self.camera(_rounded(self._seen[0]).pose.compose(self.mount))

    def _put(self, state: RigidState) -> None:
        """Begin anew from a state."""
        self.state, self._body = state, exact(state)
        late = round(self.world.delay_s * self.world.control_hz)
        self._seen = deque([self._body], maxlen=1 + late)

    def _tick(self, wanted: Wanted, believed: BodyState, dt: float) -> None:
        body, frame = self._body, self._frame
        wrench = self._motors.spin(wrench_for(wanted, believed, self._thought.inertia, self.gains), dt)
        airspeed = body.rotation.T @ (body.velocity - self._wind.blow(dt))
        drag = -self._thought.mass * np.array(self.world.drag_per_s) * airspeed
        self._motors.feel((wrench[0] + drag[2]) / frame.mass, dt)
        self._body = integrate(frame, body, wrench, body.rotation @ drag, dt)
        self._seen.append(self._body)

    def _believed(self, start: BodyState, began: BodyState, time: float) -> BodyState:
        """See above; `start` was believed at the beginning of the step, and `began` was true."""
        body, turn, fall = self._body, start.rotation @ began.rotation.T, self._gravity * time
        drift = body.position - began.position - (began.velocity + 0.5 * fall) * time
        position = start.position + (start.velocity + 0.5 * fall) * time + turn @ drift
        velocity = start.velocity + fall + turn @ (body.velocity - began.velocity - fall)
        return BodyState(position, velocity, turn @ body.rotation, body.body_rate)

    @property
    def _gravity(self) -> np.ndarray:
        return np.array([0.0, 0.0, -self._frame.gravity])


def airframe(robot: Quadrotor, world: PhysicalConfig) -> Airframe:
    """What planner, filter and tracking loop take the robot for."""
    config, arm = robot.config, world.rotor_arm_m
    return Airframe(
        config.mass,
        np.array(config.inertia),
        arm * np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]]),
        np.array([1.0, -1.0, 1.0, -1.0]),
        world.thrust_coefficient,
        world.torque_coefficient,
        config.gravity,
    )


def exact(state: RigidState) -> BodyState:
    """A state in double precision."""
    parts = (state.position, state.velocity, state.rotation, state.body_rate)
    return BodyState(*(part.detach().double().numpy() for part in parts))


def _rounded(body: BodyState) -> RigidState:
    parts = (body.position, body.velocity, body.rotation, body.body_rate)
    return RigidState(*(torch.from_numpy(part).float() for part in parts))
