"""Active looking: choose headings in which the camera sees something, and turn a robot that holds and sees too little.

A robot that holds turns first to the heading in which pictures should tell it most, then all around. What they should
tell follows from the field (expected_belief.py); where a picture from nearby showed less, that counts. Without an
inertial unit it drifts while it sees little: it goes back to its last informative view, or gives way to what is near.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import torch
from torch import Tensor

from nerfnav.estimator import Belief, FilterOutcome
from nerfnav.estimator.core.prediction import predict
from nerfnav.field import Field
from nerfnav.geometry import Pose, so3
from nerfnav.navigation.episode import NavigationStep
from nerfnav.navigation.expected_belief import expect_remainder
from nerfnav.navigation.fallback import come_to_rest
from nerfnav.navigation.flight import ActiveGoal, FlightContext
from nerfnav.navigation.landing import descend
from nerfnav.navigation.supervisor import SIGMAS, SupervisorMemory
from nerfnav.navigation.supervisor_state import StateChange, SupervisorAction, SupervisorState
from nerfnav.planner import fits
from nerfnav.planner.active_yaw import YawObjective, choose_goal_heading, limit_yaw_rate, wrap_yaw
from nerfnav.planner.active_yaw import choose_headings as choose_plan_headings
from nerfnav.planner.visibility import find_best_turn
from nerfnav.robots import POSITION, Motion, RigidState, Robot

_ARRIVING = 0.8
"""Share of the remaining angle that is turned in a step."""
_IN_VAIN_S = 0.5
"""Time beyond that of the turn after which nothing is visible where something should be [s]."""
_SOON_S, _DRAWS = 1.0, 64
"""Time over which a robot that sees too little expects collisions [s], and draws of its position."""
_DIRECTIONS = torch.nn.functional.normalize(
    torch.tensor(sorted(product((-1.0, 0.0, 1.0), repeat=3), key=lambda direction: sum(map(abs, direction)))), dim=-1
)
"""Directions of its evasions, rest before them."""
_NOTHING = 0.1
"""Share of the visibility that a camera needs, below which it sees nothing, and of the variance that a picture removes,
below which it tells nothing."""


def choose_headings(
    goal: ActiveGoal,
    here: RigidState,
    rest: Motion,
    flight: FlightContext,
    leads: bool = True,
    views: Sequence[Belief] = (),
) -> tuple[ActiveGoal, Motion]:
    """Choose a heading at the goal in which the camera sees something, and headings for the rest of a plan.

    `rest` begins at the believed state; it `leads` to the goal, else the path is taken to be straight. Headings stay
    as they are where visibility does not count. Unlike those of the first plan, they count what pictures will tell at
    the goal, where a robot that is not sure hovers; `views` are beliefs after pictures that it took.
    """
    objective = _hover_objective(goal.goal, views, flight)
    return choose_route_headings(goal, here, rest, objective, flight.simulator.robot, leads)


def choose_route_headings(
    goal: ActiveGoal, here: RigidState, rest: Motion, objective: YawObjective | None, robot: Robot, leads: bool = True
) -> tuple[ActiveGoal, Motion]:
    """Choose headings as `choose_headings` does, by an objective; None leaves them as they are."""
    if objective is None:
        return replace(goal, end=goal.goal), rest
    profile = objective.profile_along(rest.states if leads else RigidState.stack([here, goal.goal]))
    end = choose_goal_heading(objective, profile, (here, goal.plan_end))
    if leads:
        turned = choose_plan_headings(objective, profile, rest, (here, goal.plan_end, end), robot)
        if turned is not None:
            return replace(goal, end=turned.states[-1], keeps_headings=True), turned
    return replace(goal, end=end, keeps_headings=False), rest


def predict_visibility(state: RigidState, flight: FlightContext) -> tuple[float, float]:
    """Predict the visibility from a state, as a share of what is enough, and the turn to a better heading [rad]."""
    objective = yaw_objective_of(flight)
    if objective is None:
        return 1.0, 0.0
    return find_best_turn(objective.matter, state, objective.enough, objective.mount)


def find_turn(state: RigidState, views: Sequence[Belief], flight: FlightContext) -> float:
    """Find the turn of a hovering robot to the heading in which pictures should tell it most [rad].

    Where they should tell it nothing in any, to the one in which most is visible; 0 where visibility does not count.
    `views` are beliefs after pictures that it took.
    """
    objective = _hover_objective(state, views, flight)
    if objective is None or objective.remainder is None or objective.remainder.min() > 1 - _NOTHING:
        return predict_visibility(state, flight)[1]
    yaw, headings = so3.yaw_of(state.rotation).item(), len(objective.remainder)
    turns = wrap_yaw(math.tau / headings * np.arange(headings) - yaw)
    return float(turns[objective.end_cost(yaw + turns, yaw).argmin()])


def _hover_objective(place: RigidState, views: Sequence[Belief], flight: FlightContext) -> YawObjective | None:
    """Return the objective of a flight, with what pictures should tell a robot that hovers at a place."""
    objective = yaw_objective_of(flight)
    return None if objective is None else replace(objective, remainder=expect_remainder(place, views, flight))


def make_yaw_objective(
    camera_field: Field, solid: Field, robot: Robot, mount: Pose, enough: float, looks_ahead: bool = False
) -> YawObjective | None:
    """Make the objective of a robot whose camera, at `mount` T_body_camera, sees one field, and whose body fits in
    another, `solid`; a robot that watches `looks_ahead`.

    None where visibility does not count (`enough` 0, see NavigateConfig.in_sight), and on the ground, where a turn
    takes room, or changes the path.
    """
    if enough == 0 or robot.planar:
        return None
    return YawObjective(camera_field, enough, mount, partial(fits, solid, robot.body), looks_ahead=looks_ahead)


def yaw_objective_of(flight: FlightContext) -> YawObjective | None:
    """Return the objective of a flight; None where visibility does not count."""
    field, safety_filter = flight.stack.camera_field, flight.stack.safety_filter
    if field is None:
        return None
    solid = field if safety_filter is None else safety_filter.field
    robot, mount, watches = flight.simulator.robot, flight.simulator.mount, flight.stack.watch is not None
    return make_yaw_objective(field, solid, robot, mount, flight.config.in_sight, watches)


def command_yaw_rate(state: RigidState, aim: float | None, most: float, around: float, dt: float) -> float:
    """Command a yaw rate [rad/s] that turns to the heading `aim` [rad], at `most`; None: all around, at `around`.

    The command turns the robot in the step of `dt` [s] after this one.
    """
    if aim is None:
        return around
    soon = so3.yaw_of(so3.retract(state.rotation, state.body_rate * dt)).item()
    return max(-most, min(most, _ARRIVING * wrap_yaw(aim - soon) / dt))


def choose_turn(
    step: NavigationStep, memory: SupervisorMemory, flight: FlightContext, lost: bool
) -> Callable[[RigidState], float]:
    """Choose the turn of a robot that holds and sees little.

    One that is not lost turns to the heading in which pictures should tell it most where it began to hold. Else it
    turns toward the middle of the place, where there is more to see than outside.
    """
    began, safety_filter, dt = memory.plan.states[0], flight.stack.safety_filter, flight.request.dt
    config = flight.config.recovery
    most = max(config.turn, limit_yaw_rate(flight.simulator.robot, config.glance))
    turn = 0.0 if lost else find_turn(began, (*memory.views, step.filter_belief), flight)
    side = 1.0 if safety_filter is None else side_of(began, safety_filter.field.box.center)
    around = math.copysign(config.turn, turn if turn else side)
    unseen_s, aim = min(memory.unsure, step.index - memory.seen_at) * dt, None
    if turn != 0 and unseen_s <= 2 * _IN_VAIN_S + abs(turn) / most:
        aim = so3.yaw_of(began.rotation).item() + turn
    return partial(command_yaw_rate, aim=aim, most=most, around=around, dt=dt)


def hold(
    step: NavigationStep, start: RigidState, last: Motion, memory: SupervisorMemory, flight: FlightContext
) -> Motion:
    """Plan the motion of a robot that holds, from an estimate after the `last` plan.

    It comes to rest, and turns where its view tells little; one that trusts its belief goes back to its last
    informative view where no turn helps, or gives way to what it may touch, and one that was given up lands.
    """
    action, robot = step.recovery, flight.simulator.robot
    start = robot.settled(start, last.states[0])
    if action is SupervisorAction.LANDED:
        return descend(start, flight)
    turn = velocity = None
    if action is not None and action.turns:
        lost = action is SupervisorAction.SEARCHED
        if not lost and (velocity := _way_back(step, memory, flight)) is None:
            velocity = give_way(Belief(start, step.belief.covariance), flight, step.time)
        if step.filter_outcome is not FilterOutcome.UPDATED:  # what the field shows elsewhere may be wrong
            turn = choose_turn(step, memory, flight, lost)
    return come_to_rest(robot, start, flight.config.recovery.rest, flight.request.dt, turn, velocity)


def _way_back(step: NavigationStep, memory: SupervisorMemory, flight: FlightContext) -> Tensor | None:
    """Return the velocity to the pose of the last informative picture [m/s].

    None where there was none, where the robot is there, where it has just begun to turn to something, and where three
    standard deviations of its position do not fit into the clearance of the straight line there.
    """
    seen, safety_filter, config = memory.seen, flight.stack.safety_filter, flight.config.recovery
    if seen is None or safety_filter is None or memory.unsure * flight.request.dt < _IN_VAIN_S:
        return None
    here, there = step.belief.mean.position, seen.mean.position
    distance, reach = (there - here).norm().item(), SIGMAS * step.belief.position_std
    if distance < config.widest:
        return None
    shares = torch.linspace(0, 1, 2 + int(distance / reach))[:, None]
    if safety_filter.clearance(here + shares * (there - here), reach) < reach:
        return None
    return (there - here) * (min(config.back, distance / _IN_VAIN_S) / distance)


def give_way(belief: Belief, flight: FlightContext, time: float = 0.0) -> Tensor | None:
    """Return the velocity with the fewest expected collisions, from a time of the flight [s] on, of a robot that holds
    and sees too little [m/s].

    Without pictures its position after k steps is x_k ~ N(mu_k, Sigma_k), by the noise of the flight's steps. The
    expectation is sum_k P(the body does not fit at x_k, or touches a mover) over the next _SOON_S, by draws, of rest
    and of evasions in all directions. None: rest; also on the ground, and without a safety filter.
    """
    safety_filter, robot, dt = flight.stack.safety_filter, flight.simulator.robot, flight.request.dt
    if safety_filter is None or robot.planar:
        return None
    start, steps, roots = belief.mean, max(1, round(_SOON_S / dt)), list[Tensor]()
    for action in robot.roll_out_hold(start, torch.zeros(steps, 3), dt, rest=0.0).actions:
        belief = predict(belief, action, robot, dt, safety_filter.noise.process)
        roots.append(torch.linalg.cholesky(belief.covariance[POSITION, POSITION]))
    deviations = torch.randn(_DRAWS, 3, generator=torch.Generator().manual_seed(0)) @ torch.stack(roots).mT
    times, movers = time + dt * np.arange(1, steps + 1), safety_filter.movers
    boxes = None if movers is None else movers.boxes(np.repeat(times, _DRAWS), robot.body)
    fewest, best = math.inf, None
    for direction in _DIRECTIONS:
        wanted = safety_filter.config.speed * direction.expand(steps, 3)
        places = robot.roll_out_hold(start, wanted, dt, rest=0.0).states.position[1:, None] + deviations
        meets = safety_filter.blocks(places)
        if boxes is not None:
            gaps = boxes.gaps(places.reshape(-1, 3).double().numpy()).min(-1)
            meets |= torch.from_numpy(gaps <= 0).reshape(meets.shape)
        expected = meets.float().mean(-1).sum().item()
        if expected < fewest:
            fewest, best = expected, wanted[0] if direction.any() else None
    return best


def look_before_leaving(step: NavigationStep, memory: SupervisorMemory, flight: FlightContext) -> NavigationStep:
    """Return the first step of a flight: a robot that should see nothing from its start holds, BLIND, and turns."""
    mean = step.belief.mean
    if step.outcome is not None or flight.config.open_loop or predict_visibility(mean, flight)[0] > _NOTHING:
        return step
    change = StateChange(step.index, memory.state, SupervisorState.BLIND, "no view from the start shows anything")
    step = replace(step, recovery=SupervisorAction.BLIND, change=change)
    return replace(step, plan=hold(step, mean, step.plan, memory, flight))


def side_of(state: RigidState, place: Tensor) -> float:
    """Return 1 where a robot has to turn to the left to look at a place, -1 where to the right: the shorter turn."""
    ahead, away = state.rotation[:2, 0], place[:2] - state.position[:2]
    return -1.0 if ahead[0] * away[1] < ahead[1] * away[0] else 1.0
