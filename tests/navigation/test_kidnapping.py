"""A robot that is kidnapped in mid-flight: real filter, real search, a small place."""

import pytest
import torch

from nerfnav.estimator.core.filter_config import FilterConfig
from nerfnav.estimator.gauss_newton.fast_filter import FastFilter
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.estimator.relocalize.global_localization import RelocaliseConfig, RelocaliseStep
from nerfnav.estimator.relocalize.localizer import GlobalLocalizer
from nerfnav.estimator.relocalize.panorama import PanoramaConfig
from nerfnav.navigation.episode import EpisodeOutcome, NavigationStep
from nerfnav.navigation.flight import FlightRequest, NavigateConfig, NavigationStack
from nerfnav.navigation.loop import navigate
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.supervisor import SupervisorAction
from nerfnav.robots.state import RigidState
from tests.estimator.places import CAMERA, COLOR_STD, ROBOT, picture, voxel_balls
from tests.navigation.doubles import CALM, StraightPlanner, draws

START, GOAL = RigidState.at_rest((-0.6, 0.0, 0.3)), RigidState.at_rest((-0.3, 0.0, 0.3))
ELSEWHERE = RigidState.at_rest((-0.6, -0.5, 0.3), 0.6)
NOISE = ColorNoise(std=COLOR_STD)
SEARCH = RelocaliseConfig(
    PanoramaConfig(spacing=0.08, levels=2), halvings=(1, 0), kept=(24, 3), iterations=(8, 12), robust=(0.2, 0.15)
)


@pytest.mark.slow
def test_a_robot_that_was_kidnapped_finds_itself_and_reaches_its_goal() -> None:
    field = voxel_balls()
    world = Simulator(ROBOT, START, lambda pose: _seen(world), draws(0), noise=CALM)
    stack = NavigationStack(
        StraightPlanner(),
        FastFilter(field, ROBOT, CAMERA, config=FilterConfig(color_noise=NOISE)),
        GlobalLocalizer(field, CAMERA, NOISE, SEARCH),
    )
    config = NavigateConfig(noise=CALM, initial=CALM)
    steps, searched = [], 0
    for event in navigate(FlightRequest(GOAL, steps=20), world, stack, config, draws(1)):
        searched += isinstance(event, RelocaliseStep)
        if isinstance(event, NavigationStep):
            steps.append(event)
            if event.index == 3:
                world.state = ELSEWHERE
    done = [step.recovery for step in steps if step.recovery is not None]
    assert done[:3] == [SupervisorAction.WIDENED] * 2 + [SupervisorAction.RELOCALISED] and searched == 3
    assert SupervisorAction.RELOCALISED not in done[3:], "once is enough"
    assert steps[-1].outcome is EpisodeOutcome.REACHED
    assert (steps[-1].truth.position - steps[-1].belief.mean.position).norm() < 0.02


def _seen(world: Simulator) -> torch.Tensor:
    return picture(voxel_balls(), world.state)
