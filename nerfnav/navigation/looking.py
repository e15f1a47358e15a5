"""Active looking: turn a robot that holds and sees too little, first to what its field shows, then all around."""

import math
from dataclasses import dataclass, replace

from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.navigation.flight import FlightContext
from nerfnav.navigation.steps import NavigationStep, SupervisorMemory
from nerfnav.navigation.supervisor import SupervisorState, come_to_rest
from nerfnav.planner.active_yaw import limit_yaw_rate, wrap_yaw
from nerfnav.robots import Motion, RigidState

_ARRIVING = 0.8
"""Share of what is left to turn that is turned in a step."""
_IN_VAIN_S = 0.5
"""After so long beyond the time that the turn takes, there is nothing to be seen where something should be [s]."""
_NOTHING = 0.1
"""Share of what a camera needs to see below which it sees nothing."""


@dataclass(frozen=True)
class YawRateCommand:
    """Turns to a heading, or all around."""

    aim: float | None
    """The heading [rad]; None: all around."""
    most: float
    """With which it turns there at most [rad/s]."""
    around: float
    """With which it turns all around [rad/s]."""
    dt: float
    """Length of a time step [s]."""

    def __call__(self, state: RigidState) -> float:
        """The rate to turn with next [rad/s]: what is chosen now turns the robot in the step after this."""
        if self.aim is None:
            return self.around
        soon = so3.yaw_of(so3.retract(state.rotation, state.body_rate * self.dt)).item()
        return max(-self.most, min(self.most, _ARRIVING * wrap_yaw(self.aim - soon) / self.dt))


def choose_turn(doubt: SupervisorMemory, flight: FlightContext, lost: bool) -> YawRateCommand:
    """How a robot turns all the time that it holds: one that is not lost first to where it should see something, by
    where it was when that began; else to the middle of the place, for there is more to be seen than outside."""
    began, guard, dt = doubt.way.states[0], flight.pilot.guard, flight.mission.dt
    config = flight.config.recovery
    most = max(config.turn, limit_yaw_rate(flight.simulator.robot, config.glance))
    turn = 0.0 if lost else flight.sees(began)[1]
    side = 1.0 if guard is None else side_of(began, guard.field.box.center)
    around = math.copysign(config.turn, turn if turn else side)
    in_vain = doubt.unsure * dt > abs(turn) / most + _IN_VAIN_S
    aim = None if turn == 0 or in_vain else so3.yaw_of(began.rotation).item() + turn
    return YawRateCommand(aim, most, around, dt)


def hold_and_turn(
    start: RigidState, last: NavigationStep, turn: YawRateCommand | None, flight: FlightContext
) -> Motion:
    """What a robot intends that does not know where it is, and turns meanwhile."""
    robot = flight.simulator.robot
    start = robot.settled(start, last.plan.states[0])
    return come_to_rest(robot, start, flight.config.recovery.rest, flight.mission.dt, turn)


def look_before_leaving(step: NavigationStep, flight: FlightContext, doubt: SupervisorMemory) -> NavigationStep:
    """The first step of a robot that should see nothing from where it stands: it turns before it leaves."""
    mean = step.belief.mean
    if step.outcome is not None or flight.sees(mean)[0] > _NOTHING:
        return step
    plan = hold_and_turn(mean, step, choose_turn(doubt, flight, lost=False), flight)
    return replace(step, plan=plan, recovery=SupervisorState.BLIND)


def side_of(state: RigidState, place: Tensor) -> float:
    """1 where a robot has to turn to the left to look at a place, -1 where to the right: its shorter way around."""
    ahead, away = state.rotation[:2, 0], place[:2] - state.position[:2]
    return -1.0 if ahead[0] * away[1] < ahead[1] * away[0] else 1.0
