"""Navigation loop (Algorithm 1 of the paper): plan, then act, look, filter and plan again until the goal.

    plan from the start (A*, Eq. 2); look, before anything is done
    repeat:  first action of the plan -> picture -> filter (Eqs. 3-8) -> plan from the posterior mean, warm-started

While pictures disagree with the belief, the plan is to come to rest (see supervisor.py), and so it is where a
plan is no longer safe (fallback.py).
"""

from collections.abc import Generator, Iterator
from dataclasses import replace

import torch
from torch import Tensor

from nerfnav.estimator import Belief, Corrector, FilterOutcome, FilterResult
from nerfnav.estimator.core.prediction import predict
from nerfnav.geometry import so3
from nerfnav.navigation.flight import ActiveGoal, FlightContext, FlightRequest, NavigateConfig, NavigationStack
from nerfnav.navigation.looking import choose_turn, hold_and_turn, look_before_leaving
from nerfnav.navigation.realtime import Overrun, measure_time
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.steps import EpisodeOutcome, LoopEvent, NavigationStep, SupervisorMemory
from nerfnav.navigation.supervisor import LITTLE, SupervisorState
from nerfnav.planner import PlanOutcome, PlanResult, Route
from nerfnav.robots import Motion, RigidState


def navigate(
    mission: FlightRequest,
    simulator: Simulator,
    pilot: NavigationStack,
    config: NavigateConfig,
    generator: torch.Generator,
) -> Iterator[LoopEvent]:
    """Fly from where the simulator stands to the goal (Algorithm 1).

    Yields every iteration of planner and filter, and a NavigationStep for each time step, index 0 first; the last
    one has the outcome. A robot that touches the ground truth flies on, so that the estimate can be studied, but its
    outcome is COLLIDED whatever else happens. Raises what the planner raises for ends that cannot be planned
    between.
    """
    flight = FlightContext(mission, simulator, pilot, config, generator)
    step, course = yield from _begin(flight)
    doubt = SupervisorMemory(
        step.plan, unsure=int(_told_by(step.update) is None)
    )  # until a picture says where the robot is
    step = look_before_leaving(step, flight, doubt)
    yield step
    touched, held = False, 0
    while step.outcome is None:
        world = replace(flight, orders=mission.orders())
        course = course.heeding(world.orders, step.index)
        if config.open_loop:
            now = yield from _drift(step, world)
        else:
            now, course = yield from _advance(step, world, course, doubt)
        passing = _with_missed(step, now, flight)
        for step in passing:
            touched |= step.touched
            held += step.holds
            doubt = doubt.after(step)
            outcome = _judge(step, flight, course, held)
            if outcome is not None and touched:
                outcome = EpisodeOutcome.COLLIDED
            step = replace(step, outcome=outcome)
            yield step
            if outcome is not None:
                break


def _with_missed(last: NavigationStep, step: NavigationStep, flight: FlightContext) -> Iterator[NavigationStep]:
    """A time step, and in real time those that passed while it was computed."""
    yield step
    if flight.mission.realtime:
        under_way, pilot = last.plan.left_after(1), flight.pilot
        yield from Overrun(
            step, under_way, flight.simulator, pilot.estimator, flight.generator, pilot.lasting
        ).steps()


def _begin(flight: FlightContext) -> Generator[LoopEvent, None, tuple[NavigationStep, ActiveGoal]]:
    """Plan from the true start, which the user has chosen, then from where the robot believes to be, having looked."""
    mission, start, config = flight.mission, flight.simulator.state, flight.config
    goal, course = mission.goal, ActiveGoal(mission.goal, end=mission.goal)
    belief = Belief(start.retract(config.initial.sample(flight.generator)), config.initial.covariance())
    motion, spent_ms, outcome = mission.plan, 0.0, None
    if motion is None:
        planned, spent_ms = yield from measure_time(
            flight.pilot.planner.plan(Route(start, goal, mission.steps, mission.dt))
        )
        yield planned
        motion = planned.motion
        if planned.outcome is PlanOutcome.NO_PATH or not _is_finite(motion):
            outcome = EpisodeOutcome.NO_PLAN
    apparent, image, update, filter_ms = None, None, None, 0.0
    if outcome is None and not config.open_loop:
        apparent = flight.pilot.lasting.beside(belief)
        image, update, filter_ms = yield from _look(apparent, flight)
        if (seen := _told_by(update)) is not None:
            apparent, belief = seen, flight.pilot.lasting.beside(seen)
        course, motion = flight.seeing(ActiveGoal(goal), start, motion)
        route = Route(belief.mean, course.leads_to, motion.actions.shape[-2], motion.dt, course.keeps_headings)
        planned, again_ms = yield from measure_time(flight.pilot.planner.replan(motion, route, executed=0))
        yield planned
        course, motion, spent_ms = course.after(planned), planned.motion, spent_ms + again_ms
    guard, expected = flight.pilot.guard, None
    if outcome is None and guard is not None:
        expected = guard.hits_expected(motion)
        if config.most_hits is not None and expected > config.most_hits:
            outcome = EpisodeOutcome.TOO_RISKY
    step = NavigationStep(
        0, 0.0, None, start, belief, image, update, motion, False, filter_ms, spent_ms, outcome,
        hits_expected=expected, apparent=apparent,
    )  # fmt: skip
    return step, course


def _look(
    told: Belief, flight: FlightContext
) -> Generator[LoopEvent, None, tuple[Tensor | None, FilterResult | None, float]]:
    """A picture before anything is done, what it says, and how long that took [ms]; nothing where nobody looks, or the
    estimator makes nothing of what it was told."""
    estimator = flight.pilot.estimator
    if not flight.config.look_first or not isinstance(estimator, Corrector) or not estimator.trust_dynamics:
        return None, None, 0.0
    image = flight.simulator.look()
    found = estimator.correct(told, image, flight.generator)
    update, filter_ms = yield from measure_time(found, flight.mission.clock)
    return image, update, filter_ms


def _told_by(update: FilterResult | None) -> Belief | None:
    """What a picture says where the robot is; None where there was none, or it says little or something else."""
    return update.posterior if update is not None and update.outcome is FilterOutcome.UPDATED else None


def _advance(
    last: NavigationStep, flight: FlightContext, course: ActiveGoal, doubt: SupervisorMemory
) -> Generator[LoopEvent, None, tuple[NavigationStep, ActiveGoal]]:
    """One turn of Algorithm 1."""
    mission, simulator, index = flight.mission, flight.simulator, last.index + 1
    action, touched = _act(last, flight)
    image = simulator.look()
    believable = None if flight.lookout.is_lost(doubt.lost) else image  # a false belief may agree with it by chance
    update, filter_ms = yield from measure_time(
        flight.pilot.estimator.update(last.followed, believable, action, mission.dt, flight.generator), mission.clock
    )
    backup, (belief, recovery) = None, (yield from _trusted(update, image, flight, doubt))
    if recovery is not None and recovery.holds:
        turn = choose_turn(doubt, flight, recovery is SupervisorState.SEARCHED) if recovery.turns else None
        plan, replan_ms, restart = hold_and_turn(_onward(last, belief, flight), last, turn, flight), 0.0, None
    else:
        here, elsewhere = _onward(last, belief, flight), recovery is SupervisorState.RELOCALISED
        elsewhere |= course.since >= max(doubt.made, 1)
        sees_little = image is not None and update.outcome in LITTLE
        told = elsewhere, sees_little
        course, planned, replan_ms = yield from _replanned(flight, course, doubt, here, told)
        plan, restart = planned.motion, planned.restart
        if flight.pilot.guard is not None:
            began = mission.clock()
            backup, taken = flight.pilot.guard.beside(planned, mission.dt)
            replan_ms += 1e3 * (mission.clock() - began)
            plan, recovery = (backup.motion, SupervisorState.BACKUP) if taken else (plan, recovery)
    step = NavigationStep(
        index, index * mission.dt, action, simulator.state, flight.pilot.lasting.beside(belief), image, update, plan,
        touched, filter_ms, replan_ms, recovery=recovery, restart=restart, backup=backup, apparent=belief,
    )  # fmt: skip
    return step, course


def _replanned(
    flight: FlightContext, course: ActiveGoal, doubt: SupervisorMemory, here: RigidState, told: tuple[bool, bool]
) -> Generator[LoopEvent, None, tuple[ActiveGoal, PlanResult, float]]:
    """The next plan, which carries the last one on, in other headings where little is seen; and how long it took [ms].

    What is told: whether the robot is elsewhere than that plan, or goes elsewhere, and whether it sees little.
    """
    way, left, (elsewhere, sees_little) = doubt.way, flight.mission.steps, told
    clock, began = flight.mission.clock, flight.mission.clock()
    rest = way.left_after(1)
    if not elsewhere:
        left = max(doubt.steps_left(here, flight.simulator.robot), flight.config.minimum_horizon)
    if course.end is None or doubt.held or sees_little:
        course, rest = flight.seeing(course, here, rest, leads=not elsewhere)
    turned_ms = 1e3 * (clock() - began)
    route = Route(here, course.leads_to, left, rest.dt, course.keeps_headings)
    planned, planned_ms = yield from measure_time(flight.pilot.planner.replan(rest, route, executed=0), clock)
    yield planned
    return course.after(planned), planned, turned_ms + planned_ms


def _onward(last: NavigationStep, belief: Belief, flight: FlightContext) -> RigidState:
    """Where the next plan begins: where the last one has led by now, or where the robot believes to be.

    A robot that tracks plans is tilted by what it corrects. To plan from there would be to go on with the correction:
    where it is off by more than its leash, the plan is moved to it, with the tilt and the body rate that were planned.
    """
    mean, (before, led) = belief.mean, (last.plan.states[0], last.plan.states[1])
    if flight.config.leash_m == 0:
        return mean
    if (led.position - mean.position).norm() < flight.config.leash_m:
        return led
    passing = 0.5 * (before.velocity + led.velocity)  # a plan's velocities are those between two of its times
    turn = so3.from_yaw(so3.yaw_of(mean.rotation) - so3.yaw_of(led.rotation))
    return RigidState(mean.position, led.velocity + mean.velocity - passing, turn @ led.rotation, led.body_rate)


def _trusted(
    update: FilterResult, image: Tensor | None, flight: FlightContext, doubt: SupervisorMemory
) -> Generator[LoopEvent, None, tuple[Belief, SupervisorState | None]]:
    """The belief to go on with after an update, and what was done where it is not the update's own."""
    lookout, belief, wanted = flight.lookout, update.posterior, flight.orders.search
    if update.outcome is FilterOutcome.DIVERGED or lookout.is_lost(doubt.lost):
        return (yield from lookout.recover(belief, image, doubt.lost + 1, at_once=wanted))
    found = (yield from lookout.search(belief, image)) if wanted else None
    if found is not None:
        return found, SupervisorState.RELOCALISED
    if not lookout.is_blind(belief, update.outcome, doubt.unsure > 0):
        return belief, None
    shown = None if update.outcome is FilterOutcome.PREDICTED_ONLY else image  # black and plain pictures are everywhere
    return (yield from lookout.look_around(belief, shown, doubt.adrift))


def _act(last: NavigationStep, flight: FlightContext) -> tuple[Tensor, bool]:
    """Let the world move on by the first action of the plan; returns it, and whether the body touched anything."""
    simulator, orders, action = flight.simulator, flight.orders, last.plan.actions[0]
    touched = simulator.follow(last.plan, orders.gust, last.belief.mean)
    if orders.carried is not None:
        simulator.carry(orders.carried)
    return action, touched


def _drift(last: NavigationStep, flight: FlightContext) -> Generator[LoopEvent, None, NavigationStep]:
    """One time step without looking: the next planned action, and a belief that only spreads."""
    yield from ()
    simulator, dt, index = flight.simulator, flight.mission.dt, last.index + 1
    action, touched = _act(last, flight)
    belief = predict(last.belief, action, simulator.robot, dt, flight.config.filter.process_noise)
    rest = Motion(last.plan.states[1:], last.plan.actions[1:], dt)
    return NavigationStep(
        index, index * dt, action, simulator.state, belief, None, None, rest, touched, 0.0, 0.0
    )


def _judge(step: NavigationStep, flight: FlightContext, course: ActiveGoal, held: int) -> EpisodeOutcome | None:
    """Whether the flight is over, collisions aside; a robot that does not know where it is has not arrived."""
    mission, config = flight.mission, flight.config
    if step.recovery is SupervisorState.LOST:
        return EpisodeOutcome.DIVERGED
    if not _is_finite(step.plan):
        return EpisodeOutcome.NO_PLAN
    if config.open_loop and len(step.plan.actions):
        return None
    if not step.holds and (step.belief.mean.position - course.goal.position).norm() < config.goal_tolerance_m:
        return EpisodeOutcome.REACHED
    most = config.timeout_factor * mission.steps
    late = step.index - course.since - min(held, most) >= most
    return EpisodeOutcome.TIMEOUT if late or config.open_loop else None


def _is_finite(motion: Motion) -> bool:
    return bool(motion.states.position.isfinite().all() and motion.actions.isfinite().all())
