"""Landing: the end of a flight whose robot was searched for in vain.

A lost robot lands where proven free space reaches level ground below its believed position, and where it arrives there
gently: by the dynamics alone, two standard deviations of its velocity and of its tilt have to be within the limits of a
landing. Else it comes to rest in the air.

In the paper's world, noise moves the attitude: without an inertial unit the velocity of a robot without pictures drifts
by 0.2 m/s in 0.7 s, so that it lands from a few centimetres alone. With an inertial unit it lands from anywhere.
"""

import math
from dataclasses import replace

import torch

from nerfnav.estimator import Belief
from nerfnav.estimator.core.prediction import predict
from nerfnav.geometry import Pose, so3
from nerfnav.navigation.fallback import come_to_rest
from nerfnav.navigation.flight import FlightContext
from nerfnav.planner import fits, settle_on_ground
from nerfnav.robots import ATTITUDE, VELOCITY, Motion, RigidState

LEVEL = math.radians(20)
"""Largest slope of the ground on which a robot lands [rad]."""
_FASTEST, _TILT = 0.5, math.radians(15)
"""Largest speed [m/s] and tilt [rad] of a landing."""
_STILL = 0.2
"""Speed below which a lost robot counts as at rest in the air [m/s]."""
_DESCENT = 0.3
"""Speed of the descent [m/s]."""
_SIGMAS = 2.0
"""Standard deviations by which a landing is predicted to be gentle."""
_LONGEST = 100
"""Largest number of time steps of a descent."""


def descend(start: RigidState, flight: FlightContext) -> Motion:
    """Plan to descend from an estimate, straight and slowly, by the believed velocity."""
    velocity = torch.tensor([0.0, 0.0, -_DESCENT]).to(start.velocity)
    return come_to_rest(
        flight.simulator.robot, start, flight.config.recovery.rest, flight.request.dt, velocity=velocity
    )


def may_land(belief: Belief, flight: FlightContext) -> bool:
    """Check whether proven free space reaches level ground below a belief, and whether a descent ends there gently."""
    robot, safety_filter, matter = flight.simulator.robot, flight.stack.safety_filter, flight.stack.camera_field
    if robot.planar or safety_filter is None or matter is None:
        return False
    mean = belief.mean
    level = mean.moved_to(Pose(so3.from_yaw(so3.yaw_of(mean.rotation)), mean.position))
    support = settle_on_ground(matter, safety_filter.field, robot, level)
    if not support.footing.is_carried:
        return False
    top, floor = mean.position[2].item(), support.state.position[2].item()
    below = [floor] if top <= floor else torch.arange(floor, top, robot.body.extents[2]).tolist()
    column = (replace(level, position=torch.tensor([*mean.position[:2].tolist(), height])) for height in below)
    if not all(fits(safety_filter.field, robot.body, state) for state in column):
        return False
    return _ends_gently(belief, top - floor, flight)


def _ends_gently(belief: Belief, depth: float, flight: FlightContext) -> bool:
    """Predict the velocity and the tilt at the end of a descent, without pictures."""
    robot, dt, noise = flight.simulator.robot, flight.request.dt, flight.config.filter.process_noise
    steps = max(1, math.ceil(depth / (_DESCENT * dt)))
    if steps > _LONGEST:
        return False
    down = torch.tensor([0.0, 0.0, -_DESCENT])
    for action in come_to_rest(robot, belief.mean, steps, dt, velocity=down).actions:
        belief = predict(belief, action, robot, dt, noise)
    deviation = belief.covariance.diagonal().clamp_min(0).sqrt()
    speed = belief.mean.velocity.norm().item(), _SIGMAS * deviation[VELOCITY].max().item()
    return math.hypot(*speed) <= _FASTEST and _SIGMAS * deviation[ATTITUDE].max().item() <= _TILT


def has_landed(before: RigidState, truth: RigidState, flight: FlightContext) -> bool:
    """Check whether a contact between two true states is a landing: with surfaces within `LEVEL` of level alone, at
    most at 0.5 m/s and 15 degrees of tilt."""
    simulator = flight.simulator
    tilt = math.acos(max(-1.0, min(1.0, truth.rotation[2, 2].item())))
    gentle = truth.velocity.norm().item() <= _FASTEST and tilt <= _TILT
    return gentle and simulator.level_contact is not None and simulator.level_contact(before, truth)


def is_at_rest(truth: RigidState) -> bool:
    """Check whether a robot is at rest in the air, by its true velocity."""
    return truth.velocity.norm().item() < _STILL
