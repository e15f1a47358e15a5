"""Robots whose pictures disagree with what they believe: doubted, lost, found again."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest
import torch
from torch import Tensor

from nerfnav.estimator.relocalise import RelocaliseOutcome, RelocaliseStep
from nerfnav.estimator.steps import FilterOutcome, FilterStep
from nerfnav.geometry.camera import FORWARD_MOUNT, Pose
from nerfnav.navigation.episode import Episode
from nerfnav.navigation.recovery import Recovery, RecoveryConfig, recover
from nerfnav.navigation.replan import NavigateConfig, Pilot, navigate
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.steps import EpisodeOutcome, NavigationStep
from nerfnav.robots.state import POSITION
from tests.navigation.doubles import CALM, MISSION, Oracle, StraightPlanner, draws, simulator

CONFIG = NavigateConfig(initial=CALM, noise=CALM)


@dataclass
class Searcher:
    """A relocaliser that knows the truth, unless told otherwise."""

    simulator: Simulator
    outcome: RelocaliseOutcome = RelocaliseOutcome.FOUND
    asked: int = 0

    def relocalise(self, image: Tensor) -> Iterator[RelocaliseStep]:
        self.asked += 1
        pose = self.simulator.state.pose.compose(FORWARD_MOUNT)
        poses = Pose(pose.rotation[None], pose.position[None])
        step = RelocaliseStep(0.5, poses, torch.ones(1), torch.zeros(1))
        yield step
        yield replace(step, fraction=1.0, outcome=self.outcome)


@dataclass
class LostFor:
    """An estimator that disagrees with some of the pictures, counted from 0."""

    oracle: Oracle
    pictures: range
    count: int = field(default=0)

    def update(self, *parts: object) -> Iterator[FilterStep]:
        outcome = FilterOutcome.DIVERGED if self.count in self.pictures else FilterOutcome.UPDATED
        self.count += 1
        yield from replace(self.oracle, outcome=outcome).update(*parts)  # type: ignore[arg-type]


def flight(pictures: range, found: RelocaliseOutcome | None = RelocaliseOutcome.FOUND) -> list[NavigationStep]:
    world = simulator()
    searcher = None if found is None else Searcher(world, found)
    pilot = Pilot(StraightPlanner(), LostFor(Oracle(world), pictures), searcher)
    return [step for step in navigate(MISSION, world, pilot, CONFIG, draws(1)) if isinstance(step, NavigationStep)]


def test_a_picture_that_disagrees_widens_the_belief_and_one_that_agrees_ends_the_doubt() -> None:
    steps = flight(range(2, 3))
    assert [step.recovery for step in steps[1:5]] == [None, None, Recovery.WIDENED, None]
    assert steps[-1].outcome is EpisodeOutcome.REACHED
    before, after = (step.belief.covariance[POSITION, POSITION].trace() for step in steps[2:4])
    assert after > 2 * before


def test_a_robot_that_is_lost_is_searched_for_and_flies_on_from_where_it_is_found() -> None:
    steps = flight(range(2, 5))
    kinds = [step.recovery for step in steps[3:6]]
    assert kinds == [Recovery.WIDENED, Recovery.WIDENED, Recovery.RELOCALISED]
    assert steps[-1].outcome is EpisodeOutcome.REACHED
    torch.testing.assert_close(steps[5].belief.mean.position, steps[5].truth.position)
    assert len(steps[5].plan.actions) == MISSION.steps, "a robot that was found has the whole time again"


@pytest.mark.parametrize("found", [None, RelocaliseOutcome.AMBIGUOUS, RelocaliseOutcome.LOST])
def test_a_robot_that_is_not_found_again_ends_the_flight(found: RelocaliseOutcome | None) -> None:
    last = flight(range(2, 20), found)[-1]
    assert last.outcome is EpisodeOutcome.DIVERGED and last.recovery is Recovery.LOST


def test_the_episode_tells_what_was_done_also_after_storage(tmp_path: Path) -> None:
    episode = Episode.of(flight(range(2, 5)))
    assert episode.metrics()["recoveries"] == {"widened": 2, "relocalised": 1, "lost": 0}
    episode.save(tmp_path)
    assert Episode.load(tmp_path).recoveries == episode.recoveries


def test_doubt_grows_with_each_picture_until_patience_ends() -> None:
    world = simulator()
    belief = flight(range(0))[1].belief
    for lost in (1, 2):
        steps = recover(belief, torch.zeros(1), lost, RecoveryConfig(widen=2.0), Searcher(world))
        with pytest.raises(StopIteration) as end:
            next(steps)
        wider, done = end.value.value
        assert done is Recovery.WIDENED
        torch.testing.assert_close(wider.covariance, 4 * belief.covariance)
        belief = wider
