"""Navigation loop, Algorithm 1 of the paper.

    plan           from the start to the goal (A*, Eq. 2), unless the plan is given; take_off looks, and corrects the
                   plan by planning again from the belief
    repeat:
        act        first action of the plan
        look       picture of the robot's camera
        correct    filter (Eqs. 3-8): prediction by the action, correction by the picture; a robot that watches finds
                   what the field does not show (watching.py), which the plan then keeps clear of
        supervise  widen the belief, relocalize or hold where pictures disagree with it (supervisor.py)
        replan     warm-started from the posterior mean; come to rest where the supervisor holds, or where the safety
                   filter rejects the plan (fallback.py)

Each of these adds its part to the record of the time step.
"""

import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from nerfnav.estimator import (
    Belief,
    Consistency,
    Corrector,
    FilterOutcome,
    FilterStep,
    FilterUpdate,
    Predictor,
    RelocaliseResult,
    RelocaliseStep,
    correct_masked,
    update_consistently,
)
from nerfnav.estimator.core.prediction import predict
from nerfnav.geometry import so3
from nerfnav.navigation.episode import Episode, EpisodeOutcome, FlightStep, NavigationStep
from nerfnav.navigation.expected_belief import expect_sigma_in_flight
from nerfnav.navigation.first_plan import may_choose_headings, plan_first
from nerfnav.navigation.flight import (
    ActiveGoal,
    FlightContext,
    FlightRequest,
    NavigateConfig,
    NavigationStack,
    OperatorRequests,
)
from nerfnav.navigation.landing import has_landed, is_at_rest, may_land
from nerfnav.navigation.looking import choose_headings, hold, look_before_leaving, yaw_objective_of
from nerfnav.navigation.realtime import fly_missed_steps, measure_time
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.supervisor import SIGMAS, Evidence, SupervisorMemory, sees_little
from nerfnav.navigation.supervisor_state import SupervisorAction, SupervisorState
from nerfnav.navigation.watching import among_seen, find_movers, foresee_after, foresee_picture
from nerfnav.planner import PlanOutcome, PlanResult, PlanStep, PlanSteps, Route
from nerfnav.robots import Motion, RigidState

_SURE, _MOST_UNSURE = 2.0, 0.5
"""Standard deviations by which a robot is to be within the tolerance, and the largest share of it that they take."""


def navigate(
    request: FlightRequest,
    simulator: Simulator,
    stack: NavigationStack,
    config: NavigateConfig,
    generator: torch.Generator,
) -> Generator[FlightStep, None, Episode]:
    """Fly from the state of the simulator to the goal (Algorithm 1), and return the episode.

    Yields every iteration of planner and filter, and a NavigationStep for each time step, index 0 first. A contact with
    the ground truth ends the flight, unless it flies on (`config.fly_on`); leaving the field's box always does. Raises
    as the planner does for ends that cannot be planned between.
    """
    flight = FlightContext(request, simulator, stack, config, generator)
    step = yield from plan(flight)
    step, goal = yield from take_off(step, flight)
    updated = step.filter_outcome is FilterOutcome.UPDATED
    memory = SupervisorMemory(step.plan, unsure=int(not updated), seen=step.filter_belief)
    step = look_before_leaving(step, memory, flight)
    yield step
    flown = [step]
    while step.outcome is None:
        last, requests = step, request.operator()
        flight = replace(flight, stack=requests.stack or flight.stack)
        goal = goal.replaced_by(requests.goal, last.index)
        now = act(last, requests, flight)
        if config.open_loop:
            now = dead_reckon(now, last, flight)
        else:
            now = yield from correct(now, last, simulator.look(), memory, flight)
            now = yield from supervise(now, goal, memory, requests, flight)
            now, goal = yield from replan(now, last, goal, memory, flight)
        for step in _in_real_time(last, now, flight):
            memory = memory.after(
                step.index, step.plan, step.recovery, step.filter_belief, _is_informative(step, config),
                step.filter_outcome is FilterOutcome.UPDATED, step.late,
            )  # fmt: skip
            step = judge(step, flown, goal, flight)
            flown.append(replace(step, image=None, update=None))
            yield step
            if step.outcome is not None:
                break
    return Episode.of(flown)


def plan(flight: FlightContext) -> Generator[PlanStep, None, NavigationStep]:
    """Plan from the true start, which the user has chosen, to the goal; or take the plan of the request.

    It does not depend on the seed: that draws the first belief, from which take_off corrects the plan.
    """
    request, start, initial = flight.request, flight.simulator.state, flight.config.initial
    belief = Belief(start.retract(initial.sample(flight.generator)), initial.covariance())
    motion, ms, outcome = request.plan, 0.0, None
    if motion is None:
        route = Route(start, request.goal, request.steps, request.dt)
        steps = plan_first(flight.stack.planner, route, flight.simulator.robot, yaw_objective_of(flight))
        planned, ms = yield from _run_planner(steps, flight)
        motion = planned.motion
        if planned.outcome is PlanOutcome.NO_PATH or not _is_finite(motion):
            outcome = EpisodeOutcome.NO_PLAN
    return NavigationStep(
        0, 0.0, None, start, belief, None, None, motion, False, 0.0, ms, outcome, first_plan=motion
    )


def take_off(
    first: NavigationStep, flight: FlightContext
) -> Generator[FlightStep, None, tuple[NavigationStep, ActiveGoal]]:
    """Look before the first action and plan again from the belief; refuse a flight that is too risky or too blind."""
    step, goal, config = first, ActiveGoal(flight.request.goal), flight.config
    if step.outcome is None and not config.open_loop:
        step = yield from _correct_at_rest(step, flight)
        rest = step.plan
        if yaw_objective_of(flight) is not None and may_choose_headings(flight.stack.planner):
            goal = replace(goal, end=rest.states[-1], keeps_headings=True)  # the first plan has chosen them
        else:
            goal, rest = choose_headings(goal, step.truth, rest, flight)
        among = among_seen(step, flight)
        planned, ms, goal = yield from _replan(rest, step.belief.mean, goal, len(rest.actions), step.time, among)
        step = replace(step, plan=planned.motion, replan_ms=first.replan_ms + ms)
    safety_filter, most = flight.stack.safety_filter, config.most_risk
    if step.outcome is None and safety_filter is not None:
        expected = safety_filter.expected_collisions(step.plan)
        probability = safety_filter.collision_probability(step.plan, config.goal_tolerance_m, step.time)
        risky = most is not None and probability > most
        step = replace(step, hits_expected=expected, collision_probability=probability)
        step = replace(step, outcome=EpisodeOutcome.TOO_RISKY if risky else None)
    if step.outcome is None and (sigma := expect_sigma_in_flight(step.plan, flight)) is not None:
        blind = config.most_blind is not None and sigma.blind_share > config.most_blind
        step = replace(step, expected_sigma=sigma, outcome=EpisodeOutcome.TOO_RISKY if blind else None)
    return step, goal


def act(last: NavigationStep, requests: OperatorRequests, flight: FlightContext) -> NavigationStep:
    """Apply the first action of the last plan; return the next time step, with belief and plan still the last ones."""
    simulator, index = flight.simulator, last.index + 1
    touched = simulator.follow(last.plan, requests.gust, last.belief.mean)
    if requests.kidnap_pose is not None:
        simulator.kidnap(requests.kidnap_pose)
    return NavigationStep(
        index, index * flight.request.dt, last.plan.actions[0], simulator.state, last.belief, None, None, last.plan,
        touched, 0.0, 0.0, gust_mps=None if requests.gust is None else requests.gust.velocity_mps,
    )  # fmt: skip


def correct(
    now: NavigationStep, last: NavigationStep, image: Tensor | None, memory: SupervisorMemory, flight: FlightContext
) -> Generator[FilterStep, None, NavigationStep]:
    """Filter: predict by the action, correct by the picture."""
    used = None if memory.distrusts else image  # a false belief may agree with it by chance
    dt, action = flight.request.dt, last.plan.actions[0]
    estimator, monitor = flight.stack.estimator, last.consistency or Consistency()
    view = foresee_after(last, used, flight)
    steps = update_consistently(estimator, last.filter_belief, used, action, dt, flight.generator, monitor, view.hidden)
    done = yield from _run_filter(steps, replace(now, image=image), flight)
    done = replace(done, seen=find_movers(done, last.seen, view, flight))
    if done.update is None or not isinstance(estimator, Predictor):
        return done
    placed = last.recovery is None or not last.recovery.turns
    return replace(done, consistency=monitor if used is None else monitor.after(done.update, placed))


def supervise(
    now: NavigationStep, goal: ActiveGoal, memory: SupervisorMemory, requests: OperatorRequests, flight: FlightContext
) -> Generator[RelocaliseStep | RelocaliseResult, None, NavigationStep]:
    """Take the next action of the supervisor, which may widen the belief, or restart it by global localization."""
    belief, doubt, room = now.filter_belief, None, 0.0
    if flight.simulator.is_outside(belief.mean):
        place = ", ".join(f"{coordinate:.2f}" for coordinate in belief.mean.position.tolist())
        doubt = f"the estimated position ({place}) m is outside of the field's box"
    informative = now.filter_outcome is FilterOutcome.UPDATED
    if memory.held or not informative:
        room = _room(belief.mean, None if informative else goal, flight)
    evidence = Evidence(
        now.index, belief, now.filter_outcome, now.image, requests.search, doubt, room, lambda: may_land(belief, flight)
    )
    decision = yield from flight.supervisor.supervise(evidence, memory)
    belief = decision.belief
    return replace(
        now, belief=flight.stack.map_error.beside(belief), apparent=belief, recovery=decision.action,
        change=decision.change,
    )  # fmt: skip


def _room(state: RigidState, goal: ActiveGoal | None, flight: FlightContext) -> float:
    """Measure by how much a robot may be off before that harms [m]: its clearance, at most the distance to a goal; 0
    without a safety filter."""
    safety_filter, config = flight.stack.safety_filter, flight.config.recovery
    if safety_filter is None:
        return 0.0
    away = math.inf if goal is None else (state.position - goal.goal.position).norm().item()
    return safety_filter.clearance(state.position[None], min(away, SIGMAS * config.open * config.widest))


def _is_informative(step: NavigationStep, config: NavigateConfig) -> bool:
    """Check whether a picture was used; one that leaves a robot adrift said too little."""
    used = step.filter_outcome in (FilterOutcome.UPDATED, FilterOutcome.WEAK) and not step.late
    return used and step.filter_belief.position_std <= config.recovery.adrift


def replan(
    now: NavigationStep, last: NavigationStep, goal: ActiveGoal, memory: SupervisorMemory, flight: FlightContext
) -> Generator[PlanStep, None, tuple[NavigationStep, ActiveGoal]]:
    """Plan the rest of the last plan from the posterior mean; come to rest where the supervisor holds."""
    request, clock, state, flight = flight.request, flight.request.clock, now.recovery, among_seen(now, flight)
    here = _start_of_plan(last.plan, now.belief.mean, flight)
    if state is not None and state.holds:
        return replace(now, plan=hold(now, here, last.plan, memory, flight)), goal
    waits = last.recovery is SupervisorAction.BACKUP and goal.since < last.index and not memory.is_replan_due
    if waits and not _has_movers(flight):  # which may be gone in a moment, or come near
        now = replace(now, recovery=SupervisorAction.BACKUP, fallback=last.fallback)
        return replace(now, plan=hold(now, here, last.plan, memory, flight)), goal
    began, rest, steps = clock(), memory.plan.left_after(1), request.steps
    leads = state is not SupervisorAction.RELOCALISED and goal.since < max(memory.planned_at, 1)
    if leads:
        steps = max(memory.steps_left(here, flight.simulator.robot), flight.config.minimum_horizon)
        if now.seen is not None:
            steps = max(
                steps, now.seen.steps_at_pace(torch.cat([here.position[None], rest.states.position[1:]]), rest.dt)
            )
    if goal.end is None or memory.held or (now.image is not None and sees_little(now.filter_outcome)):
        goal, rest = choose_headings(goal, here, rest, flight, leads, (*memory.views, now.filter_belief))
    headings_ms = 1e3 * (clock() - began)
    planned, ms, goal = yield from _replan(rest, here, goal, steps, now.time, flight)
    now = replace(now, plan=planned.motion, restart=planned.restart, replan_ms=headings_ms + ms)
    return _filter_plan(planned, now, flight), goal


def dead_reckon(now: NavigationStep, last: NavigationStep, flight: FlightContext) -> NavigationStep:
    """Fly in open loop: the dynamics alone move the belief, and the rest of the plan is flown next."""
    dt, motion = flight.request.dt, last.plan
    belief = predict(
        last.belief, motion.actions[0], flight.simulator.robot, dt, flight.config.filter.process_noise
    )
    return replace(now, belief=belief, plan=Motion(motion.states[1:], motion.actions[1:], dt))


def judge(
    step: NavigationStep, flown: Sequence[NavigationStep], goal: ActiveGoal, flight: FlightContext
) -> NavigationStep:
    """Judge whether a flight ends at this time step, and return the step with its outcome: COLLIDED, else OUTSIDE, else
    as `_judge_arrival` says. The landing of a lost robot is no contact."""
    landed = step.touched and _is_given_up(step) and has_landed(flown[-1].truth, step.truth, flight)
    step = replace(step, touched=step.touched and not landed)
    held = sum(before.holds for before in (*flown[1:], step))
    planned = flight.request.steps
    if _has_movers(flight):  # the first plan may wait for them
        planned = max(planned, len(flown[0].plan.actions))
    outcome = EpisodeOutcome.LOST if landed else _judge_arrival(step, held, planned, goal, flight)
    if flight.simulator.is_outside(step.truth):
        outcome = EpisodeOutcome.OUTSIDE
    ends = outcome is not None or (step.touched and not flight.config.fly_on)
    touched = ends and any(before.touched for before in (*flown, step))
    return replace(step, outcome=EpisodeOutcome.COLLIDED if touched else outcome)


def _is_given_up(step: NavigationStep) -> bool:
    return step.state in (SupervisorState.LOST, SupervisorState.LANDING)


def _judge_arrival(
    step: NavigationStep, held: int, planned: int, goal: ActiveGoal, flight: FlightContext
) -> EpisodeOutcome | None:
    """Judge collisions aside; a robot that holds has not arrived, and the time that it held counts in part, beside that
    of the `planned` steps."""
    config = flight.config
    if step.state is SupervisorState.LOST and is_at_rest(step.truth):
        return EpisodeOutcome.LOST
    if not _is_finite(step.plan):
        return EpisodeOutcome.NO_PLAN
    if config.open_loop and len(step.plan.actions):
        return None
    if not step.holds and _is_there(step.belief, goal.goal, config):
        return EpisodeOutcome.REACHED
    most = config.timeout_factor * planned
    late = step.index - goal.since - min(held, most) >= most
    return EpisodeOutcome.TIMEOUT if late or config.open_loop else None


def _is_there(belief: Belief, goal: RigidState, config: NavigateConfig) -> bool:
    """Check whether the robot is within the tolerance of the goal, its uncertainty included: two standard deviations of
    the position, at most half of the tolerance, which noise lets a robot meet; none in open loop, which looks nowhere.
    """
    tolerance, distance = config.goal_tolerance_m, (belief.mean.position - goal.position).norm().item()
    unsure = 0.0 if config.open_loop else min(_SURE * belief.position_std, _MOST_UNSURE * tolerance)
    return distance + unsure < tolerance


def _correct_at_rest(step: NavigationStep, flight: FlightContext) -> Generator[FilterStep, None, NavigationStep]:
    """Correct the first belief by a picture, where one is taken and tells enough."""
    estimator = flight.stack.estimator
    step = replace(step, apparent=flight.stack.map_error.beside(step.belief))
    if not flight.config.look_first or not isinstance(estimator, Corrector) or not estimator.trust_dynamics:
        return step
    image = flight.simulator.look()
    view = foresee_picture(image, step.filter_belief, step.time, flight)
    steps = correct_masked(estimator, step.filter_belief, image, flight.generator, hidden=view.hidden)
    done = yield from _run_filter(steps, replace(step, image=image), flight)
    done = replace(done, seen=find_movers(done, None, view, flight))
    if done.filter_outcome is FilterOutcome.UPDATED:
        return replace(done, belief=flight.stack.map_error.beside(done.filter_belief))
    return replace(done, apparent=step.apparent)


def _run_filter(
    steps: FilterUpdate, step: NavigationStep, flight: FlightContext
) -> Generator[FilterStep, None, NavigationStep]:
    """Pass on the iterations of a filter, and return the time step with its result."""
    update, ms = yield from measure_time(steps, flight.request.clock)
    return replace(step, update=update, apparent=update.posterior, filter_ms=ms)


def _run_planner(
    steps: PlanSteps, flight: FlightContext
) -> Generator[PlanStep, None, tuple[PlanResult, float]]:
    """Pass on the iterations of the planner and its result; return the result and its time [ms]."""
    planned, ms = yield from measure_time(steps, flight.request.clock)
    yield planned
    return planned, ms


def _replan(
    rest: Motion, here: RigidState, goal: ActiveGoal, steps: int, time: float, flight: FlightContext
) -> Generator[PlanStep, None, tuple[PlanResult, float, ActiveGoal]]:
    """Run the planner with the rest of a plan, from a time of the flight on, as warm start; return its result, its
    time [ms], and the goal."""
    route = Route(here, goal.plan_end, steps, rest.dt, goal.keeps_headings, time)
    planned, ms = yield from _run_planner(flight.stack.planner.replan(rest, route, executed=0), flight)
    return planned, ms, replace(goal, keeps_headings=goal.keeps_headings and planned.restart is None)


def _has_movers(flight: FlightContext) -> bool:
    return flight.stack.safety_filter is not None and flight.stack.safety_filter.movers is not None


def _filter_plan(planned: PlanResult, now: NavigationStep, flight: FlightContext) -> NavigationStep:
    """Safety filter: fly the fallback trajectory where it is safe and the plan is not."""
    safety_filter, clock = flight.stack.safety_filter, flight.request.clock
    if safety_filter is None:
        return now
    began = clock()
    fallback = safety_filter.make_fallback(planned, flight.request.dt, now.time)
    rejected = safety_filter.rejects(planned, fallback, now.time)
    now = replace(now, fallback=fallback, replan_ms=now.replan_ms + 1e3 * (clock() - began))
    return replace(now, plan=fallback.motion, recovery=SupervisorAction.BACKUP) if rejected else now


def _start_of_plan(last: Motion, believed: RigidState, flight: FlightContext) -> RigidState:
    """Return the start of the next plan: the state that the last one has led to by now, or the believed state.

    A robot that tracks plans is tilted by what it corrects. A plan from there would continue the correction: where
    the robot is off by more than its leash, the plan is moved to it, with the tilt and the body rate that were planned.
    """
    before, led = last.states[0], last.states[1]
    if flight.config.leash_m == 0:
        return believed
    if (led.position - believed.position).norm() < flight.config.leash_m:
        return led
    passing = 0.5 * (before.velocity + led.velocity)  # a plan's velocities are those between two of its times
    turn = so3.from_yaw(so3.yaw_of(believed.rotation) - so3.yaw_of(led.rotation))
    return RigidState(
        believed.position, led.velocity + believed.velocity - passing, turn @ led.rotation, led.body_rate
    )


def _in_real_time(last: NavigationStep, now: NavigationStep, flight: FlightContext) -> Iterator[NavigationStep]:
    """A time step, and in real time those that passed while it was computed."""
    yield now
    if flight.request.realtime:
        yield from fly_missed_steps(last.plan.left_after(1), now, flight)


def _is_finite(motion: Motion) -> bool:
    return bool(motion.states.position.isfinite().all() and motion.actions.isfinite().all())
