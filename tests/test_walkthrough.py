"""The whole of nerfnav in one reading, on `blocks`, the smallest scene: from photographs to an exported flight."""

from pathlib import Path

import pytest
import torch

import nerfnav_scenes as scenes
from nerfnav import robots
from nerfnav.core.steps import run_steps
from nerfnav.estimator.core.filter_config import DescentConfig, FilterConfig
from nerfnav.estimator.paper.pose_filter import PoseFilter
from nerfnav.export.tables import csv_text, episode_table
from nerfnav.field.storage.checkpoint import load_field, save_field
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.loop import train
from nerfnav.geometry.camera import Camera
from nerfnav.navigation.episode import Episode, NavigationStep
from nerfnav.navigation.flight import FlightRequest, NavigateConfig, NavigationStack
from nerfnav.navigation.loop import navigate
from nerfnav.navigation.simulator import Simulator
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.planners.paper import PaperPlanner
from nerfnav.planner.solvers.adam import PlanConfig, plan
from nerfnav.world.capture import CaptureConfig, capture, split
from nerfnav.world.contact import contact_check, judge
from nerfnav.world.raycast import MeshRenderer
from tests.export.readers import table_of_csv


@pytest.mark.slow
def test_from_photographs_to_a_flight(tmp_path: Path) -> None:
    generator = torch.Generator().manual_seed(0)

    # A scene is captured into images: a few are held out, to judge by.
    scene = scenes.load("blocks")
    captured = run_steps(capture(scene, CaptureConfig(images=60, width=100, height=100), generator))
    photographs, held_out = split(captured)

    # Images train a field, which says how good it is, and is stored and read again.
    config = TrainConfig(voxel=0.02, iterations=200)
    trained = run_steps(train(photographs, held_out, scene.box, torch.tensor(scene.sky), config, generator))
    assert trained.info.psnr_db is not None and trained.info.psnr_db > 20
    save_field(trained, tmp_path / "blocks.npz")
    field = load_field(tmp_path / "blocks.npz")

    # The planner bends a trajectory through the field; the mesh, which it never saw, is the judge.
    robot, task = robots.load("quadrotor"), scene.tasks[0]
    quick = PlanConfig(iterations=150)
    planned = run_steps(plan(PlanProblem(field, robot, task.start_state, task.goal_state), quick))
    assert torch.equal(planned.motion.states.position[-1], task.goal_state.position)
    assert judge(scene, robot.body, planned.motion.states).max_overlap_m3 == 0

    # The simulator moves the truth; the robot sees nothing but its camera's pictures of the mesh.
    camera = Camera.from_fov(100, 100, 90)
    renderer = MeshRenderer(scene, supersample=2)
    simulator = Simulator(
        robot,
        task.start_state,
        camera=lambda pose: renderer.render(camera, pose).image,
        generator=generator,
        contact=contact_check(scene, robot.body),
    )

    # The filter turns each picture into a belief; the plan is made anew from it: three steps of the paper's loop.
    filtering = FilterConfig(descent=DescentConfig(iterations=150)).for_field(field.info)
    settings = NavigateConfig(filter=filtering)
    stack = NavigationStack(
        PaperPlanner(field, robot, again=PlanConfig(iterations=20)),
        PoseFilter(field, robot, camera, config=filtering),
    )
    flown: list[NavigationStep] = []
    for event in navigate(FlightRequest(task.goal_state, plan=planned.motion), simulator, stack, settings, generator):
        if isinstance(event, NavigationStep):
            flown.append(event)
        if len(flown) == 4:
            break

    # The steps join into an episode: the robot knew where it was, and the flight is taken away as a table.
    episode = Episode.of(flown)
    assert episode.metrics()["estimation"]["position_rmse_m"] < 0.05
    table = table_of_csv(csv_text(episode_table(episode, robot.action_names)))
    assert torch.allclose(table.block(("x", "y", "z")).float(), episode.truth.position)
