"""Algorithm 1, with stand-ins for planner and estimator."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import pytest
import torch
from torch import Tensor

from nerfnav.core.errors import OccupiedError
from nerfnav.core.steps import run_steps
from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_step import FilterOutcome, FilterResult, FilterStep, FilterUpdate
from nerfnav.estimator.map_error import ConsiderCovariance
from nerfnav.geometry import Box, so3
from nerfnav.navigation.episode import Episode, EpisodeOutcome, FlightStep, NavigationStep
from nerfnav.navigation.flight import FlightRequest, NavigateConfig, NavigationStack, OperatorRequests
from nerfnav.navigation.gust import GustStrength
from nerfnav.navigation.loop import navigate
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.supervisor import SupervisorAction
from nerfnav.planner.space.ends import fits
from nerfnav.planner.steps import PlanOutcome, PlanResult, PlanStep, PlanSteps
from nerfnav.planner.trajectory import Route
from nerfnav.robots import ProcessNoise, StateNoise
from nerfnav.robots.state import RigidState
from tests.navigation.doubles import CALM, GOAL, REQUEST, ROBOT, START, Oracle, StraightPlanner, draws, simulator
from tests.planner.objective.test_default_ends import field_of

CONFIG = NavigateConfig(initial=CALM, noise=CALM)


def fly(
    planner: StraightPlanner | None = None,
    world: Simulator | None = None,
    config: NavigateConfig = CONFIG,
    request: FlightRequest = REQUEST,
    lost: FilterOutcome = FilterOutcome.UPDATED,
) -> list[FlightStep]:
    world = simulator() if world is None else world
    stack = NavigationStack(StraightPlanner() if planner is None else planner, Oracle(world, lost))
    return list(navigate(request, world, stack, config, draws(1)))


@dataclass
class _Scripted:
    """An oracle that says something, or nothing, by the index of the picture."""

    simulator: Simulator
    says: Callable[[int], FilterOutcome]
    index: int = 0

    def update(
        self, belief: Belief, image: Tensor | None, action: Tensor, dt: float, generator: torch.Generator
    ) -> FilterUpdate:
        says, self.index = self.says(self.index), self.index + 1
        return (yield from Oracle(self.simulator, says).update(belief, image, action, dt, generator))


def flown_by(says: Callable[[int], FilterOutcome]) -> list[FlightStep]:
    world = simulator()
    return list(navigate(REQUEST, world, NavigationStack(StraightPlanner(), _Scripted(world, says)), CONFIG, draws(1)))


def steps_of(events: list[FlightStep]) -> list[NavigationStep]:
    return [event for event in events if isinstance(event, NavigationStep)]


def test_the_robot_reaches_the_goal():
    last = steps_of(fly())[-1]
    assert last.outcome is EpisodeOutcome.REACHED
    assert (last.truth.position - GOAL.position).norm() < CONFIG.goal_tolerance_m + 0.01


@dataclass
class _Listening:
    """An oracle that remembers what it was asked to go on with."""

    simulator: Simulator
    asked: list[Belief] = field(default_factory=list)

    def update(
        self, belief: Belief, image: Tensor | None, action: Tensor, dt: float, generator: torch.Generator
    ) -> FilterUpdate:
        self.asked.append(belief)
        return (yield from Oracle(self.simulator).update(belief, image, action, dt, generator))


def test_the_map_error_widens_beliefs_and_neither_averages_out_nor_holds_the_robot_up():
    spread = torch.diag(torch.tensor([0.05, 0.06, 0.07, 0.01, 0.02, 0.03]))
    wrong = ConsiderCovariance(tuple(spread.square().flatten().tolist()))
    world, plain = simulator(), steps_of(fly())
    listening = _Listening(world)
    stack = NavigationStack(StraightPlanner(), listening, map_error=wrong)
    steps = steps_of(list(navigate(REQUEST, world, stack, CONFIG, draws(1))))
    assert CONFIG.recovery.widest < 0.05, "so that a robot would hold for ever that took it for what pictures tell"
    assert [step.recovery for step in steps] == [step.recovery for step in plain]
    for step, before in zip(steps[1:], plain[1:], strict=True):
        assert torch.equal(step.belief.mean.position, before.belief.mean.position)
        apparent = step.belief.covariance - wrong.at(step.belief)
        torch.testing.assert_close(apparent, before.belief.covariance, rtol=0, atol=1e-8)
    for step, asked in zip(steps[1:-1], listening.asked[1:], strict=True):
        torch.testing.assert_close(asked.covariance, step.belief.covariance - wrong.at(step.belief), rtol=0, atol=1e-8)
    first = listening.asked[0].covariance - steps[0].belief.covariance
    torch.testing.assert_close(first, wrong.at(steps[0].belief), rtol=0, atol=1e-8)


def test_the_generator_returns_the_episode_of_its_steps():
    steps = steps_of(fly())
    world = simulator()
    stack = NavigationStack(StraightPlanner(), Oracle(world))
    episode = run_steps(navigate(REQUEST, world, stack, CONFIG, draws(1)))
    assert episode.outcome is steps[-1].outcome and len(episode.touched) == len(steps)
    assert torch.equal(episode.truth.position, Episode.of(steps).truth.position)


def test_each_time_step_is_filter_then_plan_then_its_record():
    kinds = [type(event) for event in fly()]
    first = kinds.index(NavigationStep)
    assert kinds[:first] == [PlanStep, PlanResult] * 2
    assert kinds[first + 1 : first + 5] == [FilterStep, PlanStep, PlanResult, NavigationStep]
    assert kinds[-1] is NavigationStep


def test_steps_are_numbered_from_the_start_and_only_the_last_has_an_outcome():
    steps = steps_of(fly())
    assert [step.index for step in steps] == list(range(len(steps)))
    assert [step.time for step in steps] == pytest.approx([0.1 * step.index for step in steps])
    assert all(step.outcome is None for step in steps[:-1])
    assert steps[0].action is None and steps[0].image is None and steps[0].update is None
    assert all(step.image is not None and step.update is not None for step in steps[1:])


def test_the_first_belief_is_off_by_what_its_covariance_says():
    errors = []
    for seed in range(200):
        world = simulator()
        stack = NavigationStack(StraightPlanner(), Oracle(world))
        flight = navigate(REQUEST, world, stack, replace(CONFIG, open_loop=True), draws(seed))
        first = next(event for event in flight if isinstance(event, NavigationStep))
        errors.append(first.belief.mean.local(first.truth))
        torch.testing.assert_close(first.belief.covariance, CALM.covariance())
    torch.testing.assert_close(torch.stack(errors).std(0), CALM.std(), rtol=0.25, atol=0)


def test_every_plan_starts_at_the_believed_state_and_its_first_action_is_flown():
    steps = steps_of(fly())
    for step in steps:
        torch.testing.assert_close(step.plan.states.position[0], step.belief.mean.position)
    for before, after in pairwise(steps):
        assert after.action is not None
        assert torch.equal(after.action, before.plan.actions[0])


def test_the_horizon_shrinks_but_never_below_the_minimum():
    planner = StraightPlanner()
    fly(planner)
    assert planner.horizons[:9] == [12, 11, 10, 9, 8, 7, 6, 6, 6]
    assert min(planner.horizons) == CONFIG.minimum_horizon


def test_a_given_first_plan_is_not_planned_again():
    planned = run_steps(StraightPlanner().plan(Route(START, GOAL, 12)))
    events = fly(StraightPlanner(outcome=PlanOutcome.NO_PATH), request=FlightRequest(GOAL, 12, 0.1, planned.motion))
    assert [type(event) for event in events[:3]] == [PlanStep, PlanResult, NavigationStep]
    assert steps_of(events)[-1].outcome is EpisodeOutcome.REACHED


def test_no_way_to_the_goal_ends_the_flight_before_it_begins():
    (only,) = steps_of(fly(StraightPlanner(outcome=PlanOutcome.NO_PATH)))
    assert only.outcome is EpisodeOutcome.NO_PLAN


def test_a_plan_of_nan_is_not_flown():
    (only,) = steps_of(fly(StraightPlanner(broken=True)))
    assert only.outcome is EpisodeOutcome.NO_PLAN


def test_a_flight_that_gets_nowhere_times_out():
    config = replace(CONFIG, goal_tolerance_m=0.0)
    steps = steps_of(fly(config=config))
    assert steps[-1].outcome is EpisodeOutcome.TIMEOUT
    assert steps[-1].index == CONFIG.timeout_factor * REQUEST.steps


def test_pictures_that_disagree_again_and_again_end_the_flight():
    steps = steps_of(fly(lost=FilterOutcome.DIVERGED))
    assert steps[-1].outcome is EpisodeOutcome.LOST
    given_up = [step.index for step in steps if step.recovery is SupervisorAction.LOST]
    assert given_up[0] == CONFIG.recovery.patience and steps[-1].truth.velocity.norm() < 0.2
    assert all(step.truth.velocity.norm() >= 0.2 for step in steps[given_up[0] : -1]), "it comes to rest first"


def test_pictures_that_say_nothing_for_a_moment_do_not_stop_a_robot_that_is_sure_and_for_longer_they_do():
    dark = round(CONFIG.recovery.unseen_s / REQUEST.dt)
    for count in (dark, dark + 1):
        steps = steps_of(flown_by(
            lambda index, last=2 + count: FilterOutcome.PREDICTED_ONLY if 2 <= index < last else FilterOutcome.UPDATED
        ))  # fmt: skip
        assert steps[-1].outcome is EpisodeOutcome.REACHED
        held = [step.recovery for step in steps if step.holds]
        assert held == ([] if count == dark else [SupervisorAction.ADRIFT])


def test_a_robot_looks_around_before_it_leaves_until_a_picture_says_something():
    steps = steps_of(flown_by(lambda index: FilterOutcome.PREDICTED_ONLY if index < 4 else FilterOutcome.UPDATED))
    assert [step.recovery for step in steps[:7]] == [None, *[SupervisorAction.BLIND] * 4, None, None]
    turned = so3.local(START.rotation, steps[4].truth.rotation).norm()
    assert turned > 0.3 and (steps[4].truth.position - START.position).norm() < 0.12, "but for the first action"
    assert steps[-1].outcome is EpisodeOutcome.REACHED


def crosses(before: RigidState, after: RigidState) -> bool:
    """Touch a plane at x = 0."""
    return bool(before.position[0] < 0 <= after.position[0])


@pytest.mark.parametrize("open_loop", [False, True])
def test_a_contact_ends_a_flight(open_loop: bool):
    steps = steps_of(fly(world=simulator(contact=crosses), config=replace(CONFIG, open_loop=open_loop)))
    assert [step.touched for step in steps] == [False] * (len(steps) - 1) + [True]
    assert steps[-1].outcome is EpisodeOutcome.COLLIDED
    assert (steps[-1].truth.position - GOAL.position).norm() > 0.3


def test_a_robot_that_shall_fly_on_touches_and_has_collided_in_the_end():
    steps = steps_of(fly(world=simulator(contact=crosses), config=replace(CONFIG, fly_on=True)))
    assert sum(step.touched for step in steps) == 1 and not steps[-1].touched
    assert steps[-1].outcome is EpisodeOutcome.COLLIDED
    assert (steps[-1].truth.position - GOAL.position).norm() < 0.1


@pytest.mark.parametrize("fly_on", [False, True])
def test_a_robot_that_leaves_the_box_of_the_field_has_ended_its_flight(fly_on: bool):
    edge = 0.1 + ROBOT.body.radius
    box = Box.of((-1.0, -1.0, 0.0), (0.1, 1.0, 1.0))
    steps = steps_of(fly(world=simulator(box=box), config=replace(CONFIG, fly_on=fly_on)))
    assert all(step.truth.position[0] <= edge for step in steps[:-1]) and steps[-1].truth.position[0] > edge
    assert steps[-1].outcome is EpisodeOutcome.OUTSIDE
    hit = steps_of(fly(world=simulator(box=box, contact=crosses), config=replace(CONFIG, fly_on=True)))
    assert hit[-1].outcome is EpisodeOutcome.COLLIDED, "the first that holds"


def test_a_gust_is_recorded_in_the_time_step_that_it_disturbs():
    gusts = iter([None, GustStrength(0.01, 0.2, 0.01, 0.1), GustStrength(0.0, 0.0, 0.0, 0.0)])
    request = replace(REQUEST, operator=lambda: OperatorRequests(gust=next(gusts, None)))
    steps = steps_of(fly(request=request))
    assert [step.gust_mps for step in steps] == [None, None, 0.2, 0.0, *[None] * (len(steps) - 4)]


def test_open_loop_flies_the_first_plan_without_looking():
    def blind(pose: object) -> torch.Tensor:
        raise AssertionError("no picture is taken in open loop")

    steps = steps_of(fly(world=simulator(camera=blind), config=replace(CONFIG, open_loop=True)))
    assert len(steps) == REQUEST.steps + 1
    assert all(step.update is None and step.image is None for step in steps)
    flown = torch.stack([step.action for step in steps[1:] if step.action is not None])
    assert torch.equal(flown, steps[0].plan.actions)
    traces = [step.belief.covariance.trace().item() for step in steps]
    assert traces == sorted(traces)


def test_without_noise_open_loop_meets_the_goal_exactly():
    steps = steps_of(fly(world=simulator(noise=None), config=replace(CONFIG, open_loop=True)))
    torch.testing.assert_close(steps[-1].truth.position, GOAL.position, atol=1e-4, rtol=0)
    assert steps[-1].outcome is EpisodeOutcome.REACHED


def test_what_the_planner_refuses_is_refused_here():
    class Refusing(StraightPlanner):
        def plan(self, route: Route) -> PlanSteps:
            raise OccupiedError("goal", "(0, 0, 0)", "is in occupied space", "move it", None)

    with pytest.raises(OccupiedError, match="occupied"):
        fly(Refusing())


def test_the_same_seeds_give_the_same_flight():
    first, second = (steps_of(fly())[-1] for _ in range(2))
    assert torch.equal(first.truth.position, second.truth.position)


def test_the_consumers_time_is_not_counted():
    clock, world = [0.0], simulator()
    request = replace(REQUEST, clock=lambda: clock[0])
    for event in navigate(request, world, NavigationStack(StraightPlanner(), Oracle(world)), CONFIG, draws(1)):
        if isinstance(event, FilterStep):
            clock[0] += 0.5
        if isinstance(event, NavigationStep) and event.index == 1:
            assert event.filter_ms == 0
            return
    pytest.fail("the flight has no first step")


def test_the_paper_preset_assumes_a_tenth_of_the_identity():
    paper = NavigateConfig.paper()
    assert paper.fly_on, "its evaluation counts contacts"
    torch.testing.assert_close(paper.filter.process_noise.covariance(), 0.1 * torch.eye(12))
    assert ROBOT.minimum_steps <= paper.minimum_horizon


def test_a_goal_that_moves_in_flight_is_flown_to():
    moved = RigidState.at_rest((-0.4, 0.5, 0.3))
    asked = []

    def requests() -> OperatorRequests:
        asked.append(None)
        return OperatorRequests(goal=moved) if len(asked) > 3 else OperatorRequests()

    planner = StraightPlanner()
    steps = steps_of(fly(planner, request=replace(REQUEST, operator=requests)))
    assert steps[-1].outcome is EpisodeOutcome.REACHED
    assert (steps[-1].truth.position - moved.position).norm() < CONFIG.goal_tolerance_m + 0.01
    assert planner.horizons[4] == REQUEST.steps, "there is time for the whole way to the new goal"
    assert len(steps) > REQUEST.steps


@pytest.mark.parametrize(("in_sight", "headings"), [(0.4, (1.8, 3.2)), (0.0, (0.0, 0.01))])
def test_plans_end_with_a_heading_in_which_something_is_seen_unless_the_goals_is_asked_for(
    in_sight: float, headings: tuple[float, float]
) -> None:
    world, wall = simulator(), ((-1.0, -1.0, -1.0), (-0.8, 1.0, 1.0))
    stack = NavigationStack(
        StraightPlanner(), Oracle(world), camera_field=field_of(((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)), wall)
    )
    steps = steps_of(list(navigate(REQUEST, world, stack, replace(CONFIG, in_sight=in_sight), draws(1))))
    assert steps[-1].outcome is EpisodeOutcome.REACHED
    for step in steps:
        if step.holds:
            continue
        end = step.plan.states[-1]
        assert headings[0] <= abs(so3.yaw_of(end.rotation).item()) <= headings[1]
        torch.testing.assert_close(end.position, GOAL.position, atol=1e-4, rtol=0)


def test_a_goal_is_turned_to_headings_alone_with_which_the_robot_fits_there() -> None:
    box, ahead = ((-1.0, -0.5, -1.0), (0.46, 0.5, 1.0)), ((0.3, -0.5, -1.0), (0.46, -0.3, 1.0))
    world, field = simulator(), field_of(box, ahead)  # 6 cm to the border: enough for a side, too little for a corner
    stack = NavigationStack(StraightPlanner(), Oracle(world), camera_field=field)
    steps = steps_of(list(navigate(REQUEST, world, stack, CONFIG, draws(1))))
    assert steps[-1].outcome is EpisodeOutcome.REACHED
    for step in steps:
        assert step.holds or fits(field, ROBOT.body, step.plan.states[-1])


def test_a_gust_pushes_the_robot_once_and_the_filter_sees_it():
    gust = StateNoise(0.3, 0.0, 0.0, 0.0)
    asked = []

    def requests() -> OperatorRequests:
        asked.append(None)
        return OperatorRequests(gust=gust if len(asked) == 3 else None)

    steps = steps_of(fly(request=replace(REQUEST, operator=requests)))
    off = [(step.truth.position - before.plan.states[1].position).norm() for before, step in pairwise(steps)]
    assert off[2] > 0.1
    assert max(off[:2] + off[3:]) < 0.02


@pytest.mark.parametrize("leash", [0.0, 0.1])
def test_plans_begin_where_the_last_one_led_as_long_as_the_belief_is_on_the_leash(leash: float) -> None:
    world, planner = simulator(noise=None), StraightPlanner()
    config = NavigateConfig(noise=CALM, leash_m=leash, goal_tolerance_m=0.1)
    steps = [
        event
        for event in navigate(REQUEST, world, NavigationStack(planner, Oracle(world)), config, draws(1))
        if isinstance(event, NavigationStep)
    ]
    for before, step, start in zip(steps, steps[1:], planner.starts[1:], strict=False):
        led = before.plan.states[1] if leash else step.belief.mean
        assert torch.equal(start.position, led.position)


def test_a_plan_is_moved_to_a_robot_that_is_off_its_leash_with_the_tilt_and_the_rate_that_were_planned() -> None:
    gust, asked, world, planner = StateNoise(0.3, 0.0, 0.0, 0.0), [], simulator(), StraightPlanner()

    def requests() -> OperatorRequests:
        asked.append(None)
        return OperatorRequests(gust=gust if len(asked) == 4 else None)

    stack, config = NavigationStack(planner, Oracle(world)), NavigateConfig(noise=CALM, leash_m=0.1)
    steps = steps_of(list(navigate(replace(REQUEST, operator=requests), world, stack, config, draws(1))))
    before, pushed, start = steps[3], steps[4], planner.starts[4]
    led = before.plan.states[1]
    assert (pushed.belief.mean.position - led.position).norm() > config.leash_m
    assert torch.equal(start.position, pushed.belief.mean.position) and torch.equal(start.body_rate, led.body_rate)
    torch.testing.assert_close(start.rotation[2], led.rotation[2])
    yaws = so3.yaw_of(torch.stack([start.rotation, pushed.belief.mean.rotation]))
    torch.testing.assert_close(yaws[0], yaws[1])


@dataclass
class _Corrector:
    """An oracle that corrects its prediction, and counts how often."""

    simulator: Simulator
    outcome: FilterOutcome = FilterOutcome.UPDATED
    trust_dynamics: bool = True
    corrected: int = 0

    def correct(
        self, prediction: Belief, image: Tensor | None, generator: torch.Generator, noise: ProcessNoise | None = None
    ) -> FilterUpdate:
        self.corrected += 1
        seen = Belief(self.simulator.state, CALM.covariance())
        step = FilterStep(0, seen.mean, 1.0, 1.0, torch.zeros(1, 2, dtype=torch.long), torch.zeros(1))
        yield step
        return FilterResult(seen, self.outcome, step)

    def update(
        self, belief: Belief, image: Tensor | None, action: Tensor, dt: float, generator: torch.Generator
    ) -> FilterUpdate:
        return (yield from Oracle(self.simulator).update(belief, image, action, dt, generator))


def begun(config: NavigateConfig, **how: object) -> tuple[NavigationStep, _Corrector, StraightPlanner]:
    """The first step of a robot that starts 3 cm a coordinate off its given start, its estimator, and its planner."""
    config = replace(config, initial=StateNoise(0.03, 0.0, 0.0, 0.0))
    world, planner = simulator(), StraightPlanner()
    looking = _Corrector(world, **how)  # type: ignore[arg-type]
    return next(
        event for event in navigate(REQUEST, world, NavigationStack(planner, looking), config, draws(1))
        if isinstance(event, NavigationStep)
    ), looking, planner  # fmt: skip


def test_a_robot_looks_before_it_leaves_and_plans_from_where_it_then_believes_to_be() -> None:
    step, looking, planner = begun(CONFIG)
    assert looking.corrected == 1 and step.image is not None and step.update is not None
    assert torch.equal(step.belief.mean.position, step.truth.position)
    torch.testing.assert_close(step.belief.covariance, CALM.covariance())
    assert torch.equal(planner.starts[0].position, step.truth.position)


@pytest.mark.parametrize(
    ("config", "how"),
    [
        (replace(CONFIG, look_first=False), {}),
        (replace(NavigateConfig.paper(), noise=CALM), {}),
        (replace(CONFIG, open_loop=True), {}),
        (CONFIG, {"trust_dynamics": False}),
    ],
)
def test_without_it_or_by_an_estimator_without_prediction_a_robot_leaves_from_its_given_start(
    config: NavigateConfig, how: dict[str, object]
) -> None:
    step, looking, _ = begun(config, **how)
    assert looking.corrected == 0 and step.image is None and step.update is None
    assert (step.belief.mean.position - step.truth.position).norm() > 0.01


@pytest.mark.parametrize("outcome", [outcome for outcome in FilterOutcome if outcome is not FilterOutcome.UPDATED])
def test_a_first_picture_that_says_little_or_disagrees_changes_no_belief(outcome: FilterOutcome) -> None:
    step, looking, _ = begun(CONFIG, outcome=outcome)
    assert looking.corrected == 1 and step.update is not None and step.update.outcome is outcome
    assert (step.belief.mean.position - step.truth.position).norm() > 0.01
