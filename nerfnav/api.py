"""Plan and fly in one call each, with the settings of `nerfnav plan` and `nerfnav fly`.

Whoever wants every iteration takes the generators that these run to their end: `nerfnav.planner.fast.plan_fast` and
`nerfnav.navigation.replan.navigate`.
"""

from dataclasses import replace

import torch

from nerfnav.estimator import FastFilter
from nerfnav.field import Unknown, VoxelField, planning_field, render_image
from nerfnav.geometry import Camera
from nerfnav.navigation import (
    CameraFunction,
    Episode,
    Mission,
    NavigateConfig,
    NavigationStep,
    Pilot,
    Simulator,
    navigate,
)
from nerfnav.planner import FastPlanConfig, FastPlanner, PlanProblem, PlanStep, last_step, plan_fast, with_room
from nerfnav.world import MeshRenderer, Scene, contact_check

CAMERA = Camera.from_fov(200, 200, 90)
"""What a robot sees with unless another camera is given."""


def plan(problem: PlanProblem, config: FastPlanConfig | None = None) -> PlanStep:
    """The trajectory that minimises paper Eq. 2, by the fast planner: its last step, which has the outcome.

    Space that no camera saw counts as solid. Raises InvalidInputError, OutsideBoxError or OccupiedError for ends that
    cannot be planned between; look at `outcome` before flying what comes back.
    """
    return last_step(plan_fast(_careful(problem), config))


def fly(
    problem: PlanProblem,
    scene: Scene | None = None,
    camera: Camera = CAMERA,
    config: NavigateConfig | None = None,
    seed: int = 0,
) -> Episode:
    """A simulated flight by Algorithm 1 of the paper to its end: plan, act, look, filter, plan again, until the goal.

    With a `scene` the camera photographs its mesh, and the episode says where the body touched it; without one the
    camera photographs the field itself, and nothing is judged. The same `seed` gives the same noise. Raises as
    `plan` does.
    """
    config, generator = config or NavigateConfig(), torch.Generator().manual_seed(seed)
    if isinstance(problem.field, VoxelField):
        config = replace(config, filter=config.filter.for_field(problem.field.info.noise_std))
    seen, robot = _careful(problem), problem.robot
    again = with_room(FastPlanConfig())
    pilot = Pilot(
        FastPlanner(seen.field, robot, again=again, terms=problem.terms),
        FastFilter(problem.field, robot, camera, config=config.filter),
    )
    contact = None if scene is None else contact_check(scene, robot.body)
    look = _pictures(problem, scene, camera)
    simulator = Simulator(robot, problem.start, look, generator, noise=config.noise, contact=contact)
    mission = Mission(problem.goal, problem.steps, problem.dt)
    events = navigate(mission, simulator, pilot, config, generator)
    return Episode.of([event for event in events if isinstance(event, NavigationStep)])


def _careful(problem: PlanProblem) -> PlanProblem:
    """The problem in the field with what no camera saw taken for solid."""
    return replace(problem, field=planning_field(problem.field, Unknown.OCCUPIED))


def _pictures(problem: PlanProblem, scene: Scene | None, camera: Camera) -> CameraFunction:
    """What photographs the scene, or else the field."""
    if scene is None:
        return lambda pose: render_image(problem.field, camera, pose).image
    renderer = MeshRenderer(scene, supersample=2)  # as the photographs that fields learn from
    return lambda pose: renderer.render(camera, pose).image
