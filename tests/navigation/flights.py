"""A small flight around a ball that several tests fly."""

import torch

from nerfnav.estimator.descent import DescentConfig
from nerfnav.estimator.filter import FilterConfig, PoseFilter
from nerfnav.estimator.noise import StateNoise
from nerfnav.field.render import render_image
from nerfnav.geometry.camera import Camera, Pose
from nerfnav.navigation.planners import PaperPlanner
from nerfnav.navigation.replan import Mission, NavigateConfig, Pilot, navigate
from nerfnav.navigation.simulator import ContactFunction, Simulator
from nerfnav.navigation.steps import NavigationStep
from nerfnav.planner.optimize import PlanConfig
from nerfnav.planner.steps import PlanStep
from nerfnav.robots.state import RigidState
from tests.planner.places import ROBOT, ball

START, GOAL = RigidState.at_rest((-0.6, -0.3, 0.4), 0.4), RigidState.at_rest((-0.3, 0.3, 0.5), -0.6)
CAMERA = Camera.from_fov(48, 48, 90)
CALM = StateNoise(position_m=0.002, velocity_mps=0.001, attitude_rad=0.002, body_rate_radps=0.001)
FIELD = ball(0.2)


def picture(pose: Pose) -> torch.Tensor:
    """What the camera sees at T_world_camera."""
    return (255 * render_image(FIELD, CAMERA, pose).color.clamp(0, 1)).round().to(torch.uint8)


def settings(**changes: object) -> NavigateConfig:
    """Short descents and little noise."""
    filtering = FilterConfig(descent=DescentConfig(iterations=10), process_noise=CALM, retries=0)
    return NavigateConfig(filter=filtering, noise=CALM, initial=CALM, **changes)  # type: ignore[arg-type]


def fly(
    config: NavigateConfig, steps: int = 8, goal: RigidState = GOAL, contact: ContactFunction | None = None, seed: int = 0
) -> tuple[list[NavigationStep], list[PlanStep]]:
    """All time steps of a flight, and all iterations of its planner."""
    generator = torch.Generator().manual_seed(seed)
    simulator = Simulator(ROBOT, START, picture, generator, noise=config.noise, contact=contact)
    pilot = Pilot(
        PaperPlanner(FIELD, ROBOT, PlanConfig(iterations=60), PlanConfig(iterations=5)),
        PoseFilter(FIELD, ROBOT, CAMERA, config=config.filter),
    )
    events = list(navigate(Mission(goal, steps), simulator, pilot, config, generator))
    flown = [event for event in events if isinstance(event, NavigationStep)]
    return flown, [event for event in events if isinstance(event, PlanStep)]
