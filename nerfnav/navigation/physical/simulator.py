"""Physical simulator: the true state is that of a rigid body, moved in hundreds of steps a second.

The controller's estimate is the filter's belief at the beginning of the time step, propagated by inertial measurements
(inertial.py); its reference is the spline through the plans' positions (reference_trajectory.py).
"""

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Pose
from nerfnav.inertial import ImuConfig
from nerfnav.navigation.gust import GustStrength
from nerfnav.navigation.physical.config import PhysicalConfig
from nerfnav.navigation.physical.geometric_controller import TrackingGains, compute_wrench
from nerfnav.navigation.physical.inertial import InertialInterval, InertialUnit, integrate_imu
from nerfnav.navigation.physical.reference_trajectory import ReferenceState, TrackedWaypoints
from nerfnav.navigation.physical.rigid_body import Airframe, BodyState, Powertrain, integrate, turning
from nerfnav.navigation.physical.wind import Wind
from nerfnav.navigation.simulator import Simulator
from nerfnav.robots import Motion, Quadrotor, QuadrotorConfig, RigidState, StateNoise

_LOOK_APART = 0.02
"""Time between two checks for contact [s]."""


@dataclass
class PhysicalSimulator(Simulator):
    """Simulator of a quadrotor in the physical world; `noise` is not used."""

    world: PhysicalConfig = field(default_factory=PhysicalConfig)
    """Its parameters."""
    gains: TrackingGains = field(default_factory=TrackingGains)
    """Gains of the controller that tracks the plan."""
    felt: tuple[InertialInterval, InertialInterval] = field(init=False)
    """Inertial measurements of the last time step until its picture was taken, and after that."""
    _flown: TrackedWaypoints = field(default_factory=TrackedWaypoints, init=False)
    _disturbance: np.ndarray = field(default_factory=lambda: np.zeros(3), init=False)

    def __post_init__(self) -> None:
        """Let the robot hover. Raises InvalidInputError for other robots than quadrotors."""
        if not isinstance(self.robot, Quadrotor):
            raise InvalidInputError(
                f"the physical world is made for quadrotors, and a {self.robot.name} is none: fly it in the paper's"
            )
        self._nominal = airframe(self.robot, self.world)
        self._frame = replace(self._nominal, mass=self._nominal.mass * (1 + self.world.mass_error))
        self._motors = Powertrain(self._nominal, self.world, self.gains.lead)
        self._wind = Wind(self.world, self.generator)
        self._inertial = InertialUnit(self.world, self.generator)
        self._put(self.state)

    def follow(
        self, plan: Motion, gust: GustStrength | StateNoise | None = None, believed: RigidState | None = None
    ) -> bool:
        """Track the first step of a plan from where the robot believes to be (see Simulator)."""
        count, late = max(1, round(plan.dt * self.world.control_hz)), self._late
        tick, gravity = plan.dt / count, self._frame.gravity
        references, self._flown = self._flown.track(plan, count, gravity)
        began = self._estimate = exact(plan.states[0] if believed is None else believed)
        pictured, checked, unchecked, touched = began, self.state, count, False
        for left, reference in zip(range(count - 1, -1, -1), references, strict=True):
            self._tick(reference, tick)
            if left == late:
                pictured = self._estimate
            if left % max(1, round(_LOOK_APART / tick)) == 0:
                self.state = _rounded(self._body)
                touched |= self.advance(checked, self.state, (unchecked - left) * tick)
                checked, unchecked = self.state, left
        if gust is not None:
            self._push(gust.sample(self.generator))
        pictured = pictured if late else self._estimate
        self.felt = (
            InertialInterval.between(began, pictured, gravity, (count - late) * tick, tick),
            InertialInterval.between(pictured, self._estimate, gravity, late * tick, tick),
        )
        return touched

    def kidnap(self, pose: Pose) -> None:
        """Move the robot to T_world_body, see Simulator."""
        super().kidnap(pose)
        self._put(self.state)

    def look(self) -> UInt8[Tensor, "height width 3"] | None:
        """Return the picture that arrives now, which is late; None where it was dropped."""
        if float(torch.rand(1, generator=self.generator)) < self.world.dropped_share:
            return None
        return self.picture(_rounded(self._seen[0]), self.time - self.world.delay_s)

    @property
    def unit(self) -> ImuConfig:
        """Inertial unit as the filter knows it."""
        return self._inertial.describe(self._frame.gravity)

    def _put(self, state: RigidState) -> None:
        """Restart from a state."""
        self.state, self._body = state, exact(state)
        self._seen = deque([self._body], maxlen=1 + self._late)

    def _push(self, by: Float[Tensor, "12"]) -> None:
        """Displace the robot, as the inertial unit feels it."""
        self.state = self.state.retract(by)
        self._body = self._seen[-1] = exact(self.state)
        self._estimate = exact(_rounded(self._estimate).retract(by))

    def _tick(self, reference: ReferenceState, dt: float) -> None:
        body, frame, believed = self._body, self._frame, self._estimate
        wrench = self._motors.spin(
            compute_wrench(reference, believed, self._disturbance, self._nominal.inertia, self.gains), dt
        )
        airspeed = body.rotation.T @ (body.velocity - self._wind.blow(dt))
        drag = -self._nominal.mass * np.array(self.world.drag_per_s) * airspeed
        self._body = integrate(frame, body, wrench, body.rotation @ drag, dt)
        self._seen.append(self._body)
        force = (drag + np.array([0.0, 0.0, wrench[0]])) / frame.mass
        rate, felt = self._inertial.measure(0.5 * (body.body_rate + self._body.body_rate), force)
        surplus = believed.rotation @ (felt - (0.0, 0.0, wrench[0] / self._nominal.mass))
        self._disturbance += (1 - np.exp(-dt * self.gains.observer)) * (surplus - self._disturbance)
        turned = turning(self._nominal.inertia, rate, wrench[1:])
        self._estimate = integrate_imu(believed, rate, felt, turned, frame.gravity, dt)

    @property
    def _late(self) -> int:
        """Latency of pictures in ticks."""
        return round(self.world.delay_s * self.world.control_hz)


def airframe(robot: Quadrotor, world: PhysicalConfig) -> Airframe:
    """Build the nominal airframe of planner, filter and controller.

    The world's rotors are those of the paper's robot. Rotors of another robot scale with its largest thrust, at the
    same speeds, and their size and distance with its body.
    """
    config, paper = robot.config, QuadrotorConfig()
    stronger, larger = config.max_thrust / paper.max_thrust, max(config.extents[:2]) / max(paper.extents[:2])
    arm = larger * world.rotor_arm_m
    return Airframe(
        config.mass,
        np.array(config.inertia),
        arm * np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]]),
        np.array([1.0, -1.0, 1.0, -1.0]),
        stronger * world.thrust_coefficient,
        stronger * larger * world.torque_coefficient,
        config.gravity,
    )


def exact(state: RigidState) -> BodyState:
    """Convert a state to double precision."""
    parts = (state.position, state.velocity, state.rotation, state.body_rate)
    return BodyState(*(part.detach().double().numpy() for part in parts))


def _rounded(body: BodyState) -> RigidState:
    parts = (body.position, body.velocity, body.rotation, body.body_rate)
    return RigidState(*(torch.from_numpy(part).float() for part in parts))
