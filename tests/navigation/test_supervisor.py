"""Robots whose pictures disagree with their belief: they hold, get lost, and are found again."""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.estimator.core.belief import POSE, Belief
from nerfnav.estimator.core.filter_step import FilterOutcome, FilterUpdate
from nerfnav.estimator.relocalize.global_localization import (
    Relocalisation,
    RelocaliseOutcome,
    RelocaliseResult,
    RelocaliseStep,
)
from nerfnav.geometry import so3
from nerfnav.geometry.camera import FORWARD_MOUNT, Pose
from nerfnav.navigation.episode import Episode, EpisodeOutcome, NavigationStep
from nerfnav.navigation.fallback import come_to_rest
from nerfnav.navigation.flight import NavigateConfig, NavigationStack, OperatorRequests
from nerfnav.navigation.loop import navigate
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.supervisor import (
    Evidence,
    StateChange,
    Supervisor,
    SupervisorAction,
    SupervisorConfig,
    SupervisorMemory,
    SupervisorState,
)
from nerfnav.planner.risk.tracking_error import PAPER_NOISE, tracking_deviations
from nerfnav.robots import StateNoise
from nerfnav.robots.state import POSITION, VELOCITY
from tests.navigation.doubles import CALM, REQUEST, ROBOT, START, Oracle, StraightPlanner, draws, grey, simulator

CONFIG = NavigateConfig(initial=CALM, noise=CALM, recovery=SupervisorConfig(lost_s=10.0))
"""Searches go on for once around."""


@dataclass
class GlobalLocalizer:
    """A relocaliser that knows the truth, or does not find the robot."""

    simulator: Simulator
    outcome: RelocaliseOutcome = RelocaliseOutcome.FOUND
    fails: int = 0
    """How many times it does not find the robot before."""
    asked: int = 0

    def relocalise(self, image: Tensor) -> Relocalisation:
        self.asked += 1
        outcome = self.outcome if self.asked > self.fails else RelocaliseOutcome.LOST
        pose = self.simulator.state.pose.compose(FORWARD_MOUNT)
        poses = Pose(pose.rotation[None], pose.position[None])
        step = RelocaliseStep(0.5, poses, torch.ones(1), torch.zeros(1))
        yield step
        last = replace(step, fraction=1.0)
        yield last
        return RelocaliseResult(outcome, last, 1e-4 * torch.eye(6))


@dataclass
class LostFor:
    """An estimator that disagrees with some of the pictures, counted from 0."""

    oracle: Oracle
    pictures: range
    count: int = field(default=0)

    def update(self, *parts: object) -> FilterUpdate:
        outcome = FilterOutcome.DIVERGED if self.count in self.pictures else FilterOutcome.UPDATED
        self.count += 1
        return (yield from replace(self.oracle, outcome=outcome).update(*parts))  # type: ignore[arg-type]


def flight(pictures: range, found: RelocaliseOutcome | None = RelocaliseOutcome.FOUND) -> list[NavigationStep]:
    world = simulator()
    searcher = None if found is None else GlobalLocalizer(world, found)
    stack = NavigationStack(StraightPlanner(), LostFor(Oracle(world), pictures), searcher)
    return [step for step in navigate(REQUEST, world, stack, CONFIG, draws(1)) if isinstance(step, NavigationStep)]


def test_a_picture_that_disagrees_widens_the_belief_and_one_that_agrees_ends_the_doubt() -> None:
    steps = flight(range(2, 3))
    assert [step.recovery for step in steps[1:5]] == [None, None, SupervisorAction.WIDENED, None]
    assert steps[-1].outcome is EpisodeOutcome.REACHED
    before, after = (step.belief.covariance[POSITION, POSITION].trace() for step in steps[2:4])
    assert after > 2 * before


def test_a_robot_that_is_lost_is_searched_for_and_flies_on_from_where_it_is_found() -> None:
    steps = flight(range(2, 5))
    kinds = [step.recovery for step in steps[3:6]]
    assert kinds == [SupervisorAction.WIDENED, SupervisorAction.WIDENED, SupervisorAction.RELOCALISED]
    assert steps[-1].outcome is EpisodeOutcome.REACHED
    torch.testing.assert_close(steps[5].belief.mean.position, steps[5].truth.position)
    assert len(steps[5].plan.actions) == REQUEST.steps, "a robot that was found has the whole time again"


@pytest.mark.parametrize("found", [RelocaliseOutcome.AMBIGUOUS, RelocaliseOutcome.LOST])
def test_a_robot_that_is_not_found_holds_and_is_looked_for_in_some_more_pictures(found: RelocaliseOutcome) -> None:
    steps = flight(range(2, 40), found)
    recovery = SupervisorConfig()
    looking = [SupervisorAction.SEARCHED] * ((recovery.searches - 1) * recovery.between)
    assert [step.recovery for step in steps[3:]] == [SupervisorAction.WIDENED] * 2 + [*looking, SupervisorAction.LOST]
    assert steps[-1].outcome is EpisodeOutcome.LOST


def test_where_nothing_searches_a_lost_robot_ends_the_flight_at_once() -> None:
    steps = flight(range(2, 20), None)
    assert [step.recovery for step in steps[3:6]] == [
        SupervisorAction.WIDENED,
        SupervisorAction.WIDENED,
        SupervisorAction.LOST,
    ]
    assert {step.recovery for step in steps[5:]} == {SupervisorAction.LOST}, "it comes to rest"
    assert steps[-1].outcome is EpisodeOutcome.LOST and steps[-1].truth.velocity.norm() < 0.2


def test_a_robot_that_does_not_know_where_it_is_comes_to_rest_and_then_goes_on() -> None:
    world = simulator()
    stack = NavigationStack(StraightPlanner(), LostFor(Oracle(world), range(5, 8)), GlobalLocalizer(world, fails=1))
    steps = [step for step in navigate(REQUEST, world, stack, CONFIG, draws(1)) if isinstance(step, NavigationStep)]
    held = [step.index for step in steps if step.holds]
    assert held == [6, 7, 8, 9, 10], "pictures that agree do not end it: only the second search does"
    speeds = [step.truth.velocity.norm().item() for step in steps]
    assert max(speeds[:6]) > 0.5 and speeds[11] < 0.35 * speeds[6]
    for step in (steps[index] for index in held):
        torch.testing.assert_close(step.plan.states.position[0], step.belief.mean.position)
        assert step.plan.states.velocity[-1].norm() < 0.2 * max(speeds), "it intends to stop"
        assert step.replan_ms == 0 and step.outcome is None
    assert steps[-1].outcome is EpisodeOutcome.REACHED
    assert (steps[-1].truth.position - REQUEST.goal.position).norm() < CONFIG.goal_tolerance_m + 0.02


def test_the_way_is_taken_up_where_it_was_left_with_the_time_that_it_takes_from_rest() -> None:
    world, planner = simulator(), StraightPlanner()
    stack = NavigationStack(planner, LostFor(Oracle(world), range(2, 4)), GlobalLocalizer(world))
    steps = [step for step in navigate(REQUEST, world, stack, CONFIG, draws(1)) if isinstance(step, NavigationStep)]
    assert [step.index for step in steps if step.holds] == [3, 4]
    # the first plan, once from the belief, after steps 1 and 2; none while it holds; then more than the 9 left
    assert planner.horizons[:3] == [12, 11, 10] and 9 < planner.horizons[3] < 18


def test_a_robot_that_holds_does_not_arrive() -> None:
    world = simulator()
    stack = NavigationStack(
        StraightPlanner(), LostFor(Oracle(world), range(100)), GlobalLocalizer(world, RelocaliseOutcome.LOST)
    )
    here = replace(REQUEST, goal=world.state)
    *_, last = navigate(here, world, stack, CONFIG, draws(1))
    assert isinstance(last, NavigationStep) and last.outcome is EpisodeOutcome.LOST


def test_a_search_that_was_asked_for_is_done_though_nothing_seems_wrong_and_what_it_finds_is_believed() -> None:
    world, taken = simulator(), []

    def asked() -> OperatorRequests:
        taken.append(None)
        return OperatorRequests(search=len(taken) == 3)

    searcher = GlobalLocalizer(world)
    stack = NavigationStack(StraightPlanner(), Oracle(world), searcher)
    events = list(navigate(replace(REQUEST, operator=asked), world, stack, CONFIG, draws(1)))
    steps = [event for event in events if isinstance(event, NavigationStep)]
    assert [step.recovery for step in steps[1:5]] == [None, None, SupervisorAction.RELOCALISED, None]
    assert searcher.asked == 1 and sum(isinstance(event, RelocaliseStep) for event in events) == 2
    believed, known = steps[3].belief.covariance.diagonal(), CONFIG.recovery.found.covariance().diagonal()
    assert torch.allclose(believed[POSE], known[POSE] + 1e-4), "the search's own covariance counts"
    assert torch.equal(believed[VELOCITY], known[VELOCITY])
    assert steps[-1].outcome is EpisodeOutcome.REACHED


def test_a_search_that_was_asked_for_and_finds_nothing_leaves_the_belief_alone() -> None:
    world = simulator()
    stack = NavigationStack(StraightPlanner(), Oracle(world), GlobalLocalizer(world, RelocaliseOutcome.AMBIGUOUS))
    request = replace(REQUEST, operator=lambda: OperatorRequests(search=True))
    steps = [step for step in navigate(request, world, stack, CONFIG, draws(1)) if isinstance(step, NavigationStep)]
    assert all(step.recovery is None for step in steps) and steps[-1].outcome is EpisodeOutcome.REACHED


def test_a_robot_in_doubt_is_searched_for_at_once_where_that_is_asked() -> None:
    world = simulator()
    stack = NavigationStack(StraightPlanner(), LostFor(Oracle(world), range(2, 3)), GlobalLocalizer(world))
    request = replace(REQUEST, operator=lambda: OperatorRequests(search=True))
    steps = [step for step in navigate(request, world, stack, CONFIG, draws(1)) if isinstance(step, NavigationStep)]
    assert steps[3].recovery is SupervisorAction.RELOCALISED


def test_a_robot_that_is_kidnapped_is_moved_before_its_picture() -> None:
    seen, taken = [], []
    there = Pose(so3.from_yaw(torch.tensor(0.7)), torch.tensor([-0.2, 0.5, 0.3]))

    def asked() -> OperatorRequests:
        taken.append(None)
        return OperatorRequests(kidnap_pose=there if len(taken) == 4 else None)

    def look(pose: Pose) -> Tensor:
        seen.append(pose.position)
        return grey(pose)

    world = simulator(camera=look)
    stack = NavigationStack(StraightPlanner(), Oracle(world), GlobalLocalizer(world))
    steps = [step for step in navigate(replace(REQUEST, operator=asked), world, stack, CONFIG, draws(1))
             if isinstance(step, NavigationStep)]  # fmt: skip
    assert torch.equal(steps[4].truth.position, there.position) and torch.equal(seen[3], there.position)
    assert steps[-1].outcome is EpisodeOutcome.REACHED


def test_a_robot_that_was_searched_for_is_given_up_when_it_has_seen_nothing_for_too_long() -> None:
    belief, config = Belief(START, CALM.covariance()), SupervisorConfig()
    for unseen, action in ((9, SupervisorAction.ADRIFT), (10, SupervisorAction.LOST)):
        for searched in (0, 4):
            _, _, found = supervised(
                Supervisor(GlobalLocalizer(simulator(), RelocaliseOutcome.LOST), config), belief,
                FilterOutcome.PREDICTED_ONLY, unseen=unseen, searched=searched,
            )  # fmt: skip
            assert found is (action if searched else SupervisorAction.ADRIFT)


def test_a_belief_outside_of_the_box_and_a_failed_test_of_consistency_are_searched_for_at_once() -> None:
    belief = Belief(START, CALM.covariance())
    memory = SupervisorMemory(come_to_rest(ROBOT, START, 2, 0.1), seen=belief)
    evidence = Evidence(3, belief, FilterOutcome.UPDATED, grey(None), doubt="the estimated position is outside")
    for outcome, after in ((RelocaliseOutcome.FOUND, None), (RelocaliseOutcome.AMBIGUOUS, SupervisorState.SEARCHING)):
        decision = run_steps(Supervisor(GlobalLocalizer(simulator(), outcome)).supervise(evidence, memory))
        assert decision.change == (after and StateChange(3, SupervisorState.TRACKING, after, evidence.doubt))
    distrusting = memory.after(3, memory.plan, decision.action, belief, informative=False)
    assert distrusting.distrusts, "pictures that agree do not end it"


def test_a_robot_remembers_its_last_informative_view_and_how_long_ago_it_saw_anything() -> None:
    first, later = (Belief(START, replace(CALM, position_m=std).covariance()) for std in (0.01, 0.02))
    memory = SupervisorMemory(come_to_rest(ROBOT, START, 2, 0.1), seen=first)
    weak = memory.after(1, memory.plan, SupervisorAction.BLIND, later, updated=False)
    nothing = weak.after(2, memory.plan, SupervisorAction.BLIND, later, informative=False, updated=False)
    assert (weak.seen, weak.seen_at, weak.unseen) == (first, 0, 0)
    assert (nothing.seen, nothing.seen_at, nothing.unseen) == (first, 0, 1)
    again = nothing.after(3, memory.plan, None, later)
    assert (again.seen, again.seen_at, again.unseen) == (later, 3, 0)


def test_a_belief_may_be_as_wide_as_three_standard_deviations_fit_into_the_room() -> None:
    config = SupervisorConfig()
    assert config.limits(0.0) == config.limits(0.12) == (config.widest, config.sure, config.adrift)
    torch.testing.assert_close(torch.tensor(config.limits(0.24)), 2 * torch.tensor(config.limits(0.0)))
    assert config.limits(10.0).widest == pytest.approx(config.open * config.widest)
    belief = Belief(START, replace(CALM, position_m=0.06).covariance())
    memory = SupervisorMemory(come_to_rest(ROBOT, START, 2, 0.1), seen=belief)
    for room, action in ((0.1, SupervisorAction.BLIND), (0.2, None)):
        evidence = Evidence(1, belief, FilterOutcome.WEAK, grey(None), room=room)
        assert run_steps(Supervisor(None).supervise(evidence, memory)).action is action


def test_a_lost_robot_lands_where_it_can_and_nothing_ends_the_landing() -> None:
    belief = Belief(START, CALM.covariance())
    memory = SupervisorMemory(come_to_rest(ROBOT, START, 2, 0.1), seen=belief, **_searched(24))
    for lands, action in ((True, SupervisorAction.LANDED), (False, SupervisorAction.LOST)):
        evidence = Evidence(1, belief, FilterOutcome.UPDATED, may_land=lambda lands=lands: lands)
        decision = run_steps(Supervisor(None).supervise(evidence, memory))
        assert decision.action is action and "searched in vain" in decision.change.reason
        going_on = memory.after(1, memory.plan, action, belief)
        assert run_steps(Supervisor(None).supervise(evidence, going_on)).action is action


def test_the_episode_tells_what_was_done_also_after_storage(tmp_path: Path) -> None:
    episode = Episode.of(flight(range(2, 5)))
    counts = dict.fromkeys((action.name.lower() for action in SupervisorAction), 0)
    assert episode.metrics()["recoveries"] == counts | {"widened": 2, "relocalised": 1}
    changes = episode.metrics()["transitions"]
    assert [(change["step"], change["from"], change["to"]) for change in changes] == [
        (3, "tracking", "searching"), (5, "searching", "tracking"), (len(episode.actions), "tracking", "ended"),
    ]  # fmt: skip
    assert changes[0]["reason"] == "pictures that disagree with the belief: 1"
    episode.save(tmp_path)
    loaded = Episode.load(tmp_path)
    assert loaded.recoveries == episode.recoveries and loaded.transitions == episode.transitions


def supervised(
    supervisor: Supervisor, belief: Belief, outcome: FilterOutcome, requested: bool = False, **counts: Any
) -> tuple[list[RelocaliseStep], Belief, SupervisorAction | None]:
    """The steps of a search, and the result of a transition after so many pictures of each kind."""
    memory = SupervisorMemory(come_to_rest(ROBOT, START, 2, 0.1), **({"seen": belief} | counts))
    evidence = Evidence(1, belief, outcome, grey(None), requested)
    generator, steps = supervisor.supervise(evidence, memory), []
    while True:
        try:
            steps.append(next(generator))
        except StopIteration as end:
            return steps, end.value.belief, end.value.action


def test_beliefs_are_widened_with_each_picture_until_patience_ends() -> None:
    world = simulator()
    belief = flight(range(0))[1].belief
    for disagreed in (0, 1):
        supervisor = Supervisor(GlobalLocalizer(world), SupervisorConfig(widen=2.0))
        steps, wider, state = supervised(supervisor, belief, FilterOutcome.DIVERGED, disagreed=disagreed)
        assert not steps and state is SupervisorAction.WIDENED
        torch.testing.assert_close(wider.covariance, 4 * belief.covariance)
        belief = wider


_NEAR, _WIDE = 0.06, 0.2
"""Standard deviations of a belief that is BLIND with a weak picture, and of one that is worth a search [m]."""


def _searched(pictures: int) -> dict[str, Any]:
    """Counts of a robot whose belief is not trusted."""
    return {"disagreed": 2, "searched": pictures, "distrusts": True}


@pytest.mark.parametrize(("outcome", "deviation", "requested", "counts", "found", "lost"), [
    ("DIVERGED", 0.01, False, {}, "WIDENED", "WIDENED"),
    ("DIVERGED", 0.01, True, {}, "RELOCALISED", "SEARCHED"),
    ("DIVERGED", 0.01, False, {"disagreed": 2}, "RELOCALISED", "SEARCHED"),
    ("UPDATED", 0.01, False, _searched(1), "SEARCHED", "SEARCHED"),
    ("UPDATED", 0.01, True, _searched(1), "RELOCALISED", "SEARCHED"),
    ("UPDATED", 0.01, False, _searched(3 * 7), "RELOCALISED", "SEARCHED"),
    ("UPDATED", 0.01, False, _searched(3 * 8), "RELOCALISED", "LOST"),
    ("UPDATED", 0.01, True, {}, "RELOCALISED", None),
    ("UPDATED", _WIDE, False, {}, None, None),
    ("UPDATED", 0.045, False, {"unsure": 1}, "BLIND", "BLIND"),
    ("UPDATED", 0.035, False, {"unsure": 1}, None, None),
    ("WEAK", 0.035, False, {"unsure": 1}, "BLIND", "BLIND"),
    ("UPDATED", 0.025, False, {"unsure": 1}, None, None),
    ("PREDICTED_ONLY", 0.025, False, {"unsure": 1}, "BLIND", "BLIND"),
    ("WEAK", 0.035, False, {}, None, None),
    ("WEAK", _NEAR, False, {}, "BLIND", "BLIND"),
    ("WEAK", _NEAR, True, {}, "RELOCALISED", "BLIND"),
    ("PREDICTED_ONLY", _WIDE, False, {}, "ADRIFT", "ADRIFT"),
    ("WEAK", _WIDE, False, {}, "RELOCALISED", "ADRIFT"),
    ("WEAK", _WIDE, False, {"searched": 1}, "ADRIFT", "ADRIFT"),
    ("WEAK", _WIDE, False, {"searched": 3}, "RELOCALISED", "ADRIFT"),
    ("WEAK", _WIDE, False, {"searched": 24}, "RELOCALISED", "LOST"),
    ("PREDICTED_ONLY", 0.01, False, {"unseen": 4}, None, None),
    ("PREDICTED_ONLY", 0.01, False, {"unseen": 5}, "ADRIFT", "ADRIFT"),
    ("WEAK", 0.01, False, {"unseen": 5}, None, None),
    ("UPDATED", 0.01, False, {"state": SupervisorState.LOST}, "LOST", "LOST"),
    ("UPDATED", 0.01, False, {"state": SupervisorState.LANDING}, "LANDED", "LANDED"),
])  # fmt: skip
def test_each_transition_enters_its_state(
    outcome: str, deviation: float, requested: bool, counts: dict[str, Any], found: str | None, lost: str | None
) -> None:
    """`found` and `lost`: the states where a search finds the robot, and where it does not."""
    belief = Belief(START, replace(CALM, position_m=deviation).covariance())
    for expected, search in ((found, RelocaliseOutcome.FOUND), (lost, RelocaliseOutcome.AMBIGUOUS)):
        supervisor = Supervisor(GlobalLocalizer(simulator(), search))
        _, after, state = supervised(supervisor, belief, FilterOutcome[outcome], requested, **counts)
        assert state is (None if expected is None else SupervisorAction[expected])
        kept = state not in (SupervisorAction.WIDENED, SupervisorAction.RELOCALISED)
        assert torch.equal(after.covariance, belief.covariance) is kept


def test_a_robot_that_is_found_turned_moves_in_its_own_axes_as_it_did() -> None:
    world = simulator()
    before = replace(world.state, velocity=torch.tensor([0.5, 0.0, 0.1]), body_rate=torch.tensor([0.0, 0.1, 0.2]))
    world.kidnap(Pose(so3.from_yaw(torch.tensor(torch.pi / 2)), torch.tensor([0.1, 0.2, 0.3])))
    steps = Supervisor(GlobalLocalizer(world)).search(Belief(before, CALM.covariance()), torch.zeros(1))
    belief = run_steps(steps)
    assert belief is not None
    found = belief.mean
    torch.testing.assert_close(found.velocity, torch.tensor([0.0, 0.5, 0.1]))
    assert torch.equal(found.body_rate, before.body_rate)


def test_the_motion_of_a_robot_that_holds_obeys_its_dynamics_and_ends_in_rest() -> None:
    start = replace(simulator().state, velocity=torch.tensor([0.8, -0.3, 0.1]))
    motion = come_to_rest(ROBOT, start, 20, 0.1)
    for index, action in enumerate(motion.actions):
        torch.testing.assert_close(ROBOT.step(motion.states[index], action, 0.1).position,
                                   motion.states.position[index + 1])  # fmt: skip
    assert motion.states.velocity[-1].norm() < 0.01


def test_a_lost_robot_turns_between_two_searches_and_is_searched_for_in_every_third_picture() -> None:
    world = simulator()
    searcher = GlobalLocalizer(world, RelocaliseOutcome.AMBIGUOUS)
    stack = NavigationStack(StraightPlanner(), LostFor(Oracle(world), range(2, 40)), searcher)
    steps = [step for step in navigate(REQUEST, world, stack, CONFIG, draws(1)) if isinstance(step, NavigationStep)]
    recovery = CONFIG.recovery
    assert searcher.asked == recovery.searches
    turning = [step for step in steps if step.recovery is SupervisorAction.SEARCHED]
    rates = [step.plan.states.body_rate[-1, 2].item() for step in turning]
    assert min(rates) > 0.9 * recovery.turn and max(rates) < 1.1 * recovery.turn
    turns = [so3.local(before.truth.rotation, after.truth.rotation)[2].item() for before, after in pairwise(turning)]
    assert sum(turns) > 1.7 * torch.pi, "it has looked all around"


@dataclass
class Unseeing:
    """An estimator to which some pictures, counted from 0, say nothing, and one before disagrees."""

    oracle: Oracle
    dark: range
    disagreeing: int | None = None
    count: int = field(default=0)

    def update(self, *parts: object) -> FilterUpdate:
        outcome = FilterOutcome.PREDICTED_ONLY if self.count in self.dark else FilterOutcome.UPDATED
        outcome = FilterOutcome.DIVERGED if self.count == self.disagreeing else outcome
        self.count += 1
        return (yield from replace(self.oracle, outcome=outcome).update(*parts))  # type: ignore[arg-type]


@dataclass
class Unsure:
    """An estimator to which pictures tell little of a belief that the start left wide."""

    oracle: Oracle
    outcome: FilterOutcome = FilterOutcome.WEAK

    def update(self, *parts: object) -> FilterUpdate:
        belief = parts[0]
        assert isinstance(belief, Belief)
        known = float(belief.covariance.diagonal()[POSITION].max()) < CONFIG.recovery.sure**2
        outcome = FilterOutcome.UPDATED if known else self.outcome
        return (yield from replace(self.oracle, outcome=outcome).update(*parts))  # type: ignore[arg-type]


def unsure_flight(spread: float, searcher: GlobalLocalizer | None, outcome: FilterOutcome) -> list[NavigationStep]:
    world = simulator() if searcher is None else searcher.simulator
    stack = NavigationStack(StraightPlanner(), Unsure(Oracle(world), outcome), searcher)
    config = replace(CONFIG, initial=replace(CALM, position_m=spread))
    return [step for step in navigate(REQUEST, world, stack, config, draws(1)) if isinstance(step, NavigationStep)]


def test_a_blind_robot_that_may_be_anywhere_near_is_searched_for_and_flies_on_from_where_it_is_found() -> None:
    searcher = GlobalLocalizer(simulator(), fails=2)
    steps = unsure_flight(1.1 * CONFIG.recovery.adrift, searcher, FilterOutcome.WEAK)
    between = CONFIG.recovery.between
    kinds = [step.recovery for step in steps[1 : 2 * between + 3]]
    assert kinds == [SupervisorAction.ADRIFT] * 2 * between + [SupervisorAction.RELOCALISED, None]
    assert searcher.asked == 3 and steps[-1].outcome is EpisodeOutcome.REACHED
    torch.testing.assert_close(steps[2 * between + 1].belief.mean.position, steps[2 * between + 1].truth.position)


def test_a_blind_robot_that_is_not_found_once_around_is_given_up_and_its_pictures_were_believed_until_then() -> None:
    searcher = GlobalLocalizer(simulator(), RelocaliseOutcome.AMBIGUOUS)
    steps = unsure_flight(1.1 * CONFIG.recovery.adrift, searcher, FilterOutcome.WEAK)
    assert searcher.asked == CONFIG.recovery.searches
    assert [step.recovery for step in steps[1:]] == [SupervisorAction.ADRIFT] * 24 + [SupervisorAction.LOST]
    assert all(step.update is not None and step.update.outcome is FilterOutcome.WEAK for step in steps[1:])
    assert steps[-1].outcome is EpisodeOutcome.LOST


def test_pictures_of_nothing_are_not_searched_with() -> None:
    searcher = GlobalLocalizer(simulator())
    steps = unsure_flight(1.1 * CONFIG.recovery.adrift, searcher, FilterOutcome.PREDICTED_ONLY)
    assert searcher.asked == 0 and all(step.holds for step in steps[1:])


def test_a_blind_robot_that_is_not_far_off_looks_around_and_is_not_searched_for() -> None:
    steps = unsure_flight(0.7 * CONFIG.recovery.adrift, GlobalLocalizer(simulator()), FilterOutcome.WEAK)
    found = next((step.index for step in steps if step.recovery is SupervisorAction.RELOCALISED), len(steps))
    assert found > 5 and {step.recovery for step in steps[1:found]} == {SupervisorAction.BLIND}
    assert all(step.belief.position_std <= CONFIG.recovery.adrift for step in steps[1:found])


def unseeing_flight(dark: range, disagreeing: int | None, spread: float = 0.01) -> list[NavigationStep]:
    world = simulator()
    stack = NavigationStack(StraightPlanner(), Unseeing(Oracle(world), dark, disagreeing), GlobalLocalizer(world))
    config = replace(CONFIG, initial=replace(CALM, position_m=spread))
    return [step for step in navigate(REQUEST, world, stack, config, draws(1)) if isinstance(step, NavigationStep)]


def test_a_robot_in_doubt_that_sees_nothing_stays_in_doubt_and_looks_around() -> None:
    steps = unseeing_flight(range(4, 9), disagreeing=3)
    assert steps[4].recovery is SupervisorAction.WIDENED
    assert [step.recovery for step in steps[5:11]] == [SupervisorAction.BLIND] * 4 + [SupervisorAction.ADRIFT, None]
    assert steps[7].plan.states.body_rate[-1, 2].item() == pytest.approx(CONFIG.recovery.turn, rel=0.1)
    assert steps[-1].outcome is EpisodeOutcome.REACHED


def test_a_robot_that_knows_where_it_is_flies_on_where_it_sees_nothing() -> None:
    steps = unseeing_flight(range(4, 9), disagreeing=None)
    assert all(step.recovery is None for step in steps) and steps[-1].outcome is EpisodeOutcome.REACHED


def test_a_robot_that_sees_nothing_and_may_be_anywhere_near_looks_around_and_is_given_up() -> None:
    steps = unseeing_flight(range(60), disagreeing=None, spread=2 * CONFIG.recovery.widest)
    blind = round(CONFIG.recovery.unseen_s / REQUEST.dt)
    kinds = [SupervisorAction.BLIND] * blind + [SupervisorAction.ADRIFT] * 24 + [SupervisorAction.LOST]
    assert [step.recovery for step in steps[1:]] == kinds and steps[-1].outcome is EpisodeOutcome.LOST
    changes = [(change.before.name, change.after.name) for change in Episode.of(steps).transitions]
    assert changes == [("TRACKING", "BLIND"), ("BLIND", "SEARCHING"), ("SEARCHING", "LOST"), ("LOST", "ENDED")]


def test_in_the_papers_noise_a_robot_looks_around_before_it_is_farther_off_than_plans_keep_clear() -> None:
    world = simulator()
    for little in (FilterOutcome.PREDICTED_ONLY, FilterOutcome.WEAK):
        spread, pictures = 1e-6 * torch.eye(12), 0
        while pictures < 50 and supervised(Supervisor(None), Belief(world.state, spread), little)[2] is None:
            spread, pictures = spread + StateNoise().covariance(), pictures + 1
        level = tracking_deviations(ROBOT, REQUEST.dt, PAPER_NOISE)[-1].level
        assert 1 < pictures <= 5 and SupervisorConfig().widest <= level
        assert supervised(Supervisor(None), Belief(world.state, spread), FilterOutcome.UPDATED)[2] is None


@pytest.mark.slow
def test_a_picture_that_agrees_but_tells_little_does_not_end_the_doubt() -> None:
    world = simulator()
    stack = NavigationStack(StraightPlanner(), LostFor(Oracle(world), range(3, 4)), GlobalLocalizer(world))
    config = replace(CONFIG, recovery=SupervisorConfig(sure=1e-4, widest=1e-4, unseen_s=10.0))
    steps = [step for step in navigate(REQUEST, world, stack, config, draws(1)) if isinstance(step, NavigationStep)]
    assert steps[4].recovery is SupervisorAction.WIDENED
    assert {step.recovery for step in steps[5:]} == {SupervisorAction.BLIND}
    rates = [abs(step.plan.states.body_rate[-1, 2].item()) for step in steps[5:]]
    assert max(rates) < 0.1, "it does not turn away from a view that says something"


def test_a_search_that_is_requested_between_two_others_is_done_at_once() -> None:
    world, belief = simulator(), flight(range(0))[1].belief
    searcher = GlobalLocalizer(world)
    _, _, state = supervised(Supervisor(searcher), belief, FilterOutcome.DIVERGED, **_searched(1))
    assert state is SupervisorAction.SEARCHED and searcher.asked == 0
    steps, _, _ = supervised(Supervisor(searcher), belief, FilterOutcome.DIVERGED, requested=True, **_searched(1))
    assert steps[-1].outcome is RelocaliseOutcome.FOUND


@pytest.mark.parametrize("option", ["open", "back", "widest", "glance"])
def test_limits_that_let_nothing_move_are_refused(option: str) -> None:
    with pytest.raises(InvalidInputError, match=f"{option} must be a number above 0"):
        replace(SupervisorConfig(), **{option: 0.0})
