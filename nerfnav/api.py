"""Plan, fly and filter in one call each, with the settings of `nerfnav plan` and `nerfnav fly`.

For every iteration, use the generators that these run to their end: `nerfnav.planner.solvers.fast.plan_fast`,
`nerfnav.navigation.loop.navigate` and `Estimator.update`.
"""

from dataclasses import replace
from typing import Literal

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

import nerfnav.world as world  # loaded where it is first used: half a second, for which no plan need wait
from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief, ConsiderCovariance, Estimator, FastFilter, FilterResult
from nerfnav.field import GridField, UnknownSpace, planning_field, render_image
from nerfnav.geometry import Camera
from nerfnav.navigation import (
    CameraFunction,
    Episode,
    FlightRequest,
    NavigateConfig,
    NavigationStack,
    NavigationStep,
    Simulator,
    build_safe_planner,
    navigate,
    world_generator,
)
from nerfnav.planner import (
    FastPlanConfig,
    PlanProblem,
    PlanResult,
    PlanSteps,
    estimate_timing,
    find_shortest_plan,
    map_for,
    path_length,
    plan_fast,
    planners,
)


def plan(
    problem: PlanProblem, config: FastPlanConfig | None = None, duration: Literal["auto"] | None = None
) -> PlanResult:
    """The trajectory that minimises paper Eq. 2, by the fast planner.

    The problem says how long the robot takes, which is the paper's 2 s unless it says otherwise; with the duration
    "auto", the shortest plan is found that keeps the robot's limits (see planner/solvers/duration.py), as places of
    other sizes need it. Space that no camera saw counts as solid. Raises InvalidInputError, OutsideBoxError or
    OccupiedError for ends that cannot be planned between; look at `outcome` before flying what comes back.
    """
    problem = _careful(problem)
    if duration is None:
        return run_steps(plan_fast(problem, config))
    config = FastPlanConfig() if config is None else config
    occupancy = map_for(problem, config.occupancy).remembering()
    timing = estimate_timing(problem.robot, path_length(problem, occupancy, config.search), problem.dt)

    def lasting(steps: int) -> PlanSteps:
        return plan_fast(replace(problem, steps=steps, dt=timing.dt), config, occupancy)

    return run_steps(find_shortest_plan(lasting, problem.robot, timing.config))


def fly(
    problem: PlanProblem,
    scene: "world.Scene | None" = None,
    camera: Camera | None = None,
    config: NavigateConfig | None = None,
    seed: int = 0,
) -> Episode:
    """A simulated flight by Algorithm 1 of the paper to its end: plan, act, look, filter, plan again, until the goal.

    With a `scene` the camera (by default the robot's own) photographs its mesh, and the episode says where the body
    touched it; without one it photographs the field itself, and nothing is judged. The same `seed` gives the same
    noise. Raises as `plan` does.
    """
    config, generator = config or NavigateConfig(), torch.Generator().manual_seed(seed)
    seen, robot, lasting = _careful(problem), problem.robot, ConsiderCovariance()
    if isinstance(problem.field, GridField):
        info = problem.field.info
        config = replace(config, filter=config.filter.for_field(info))
        lasting = lasting if scene is None else ConsiderCovariance(info.pose_floor, robot.mount)
    camera, settings = camera or robot.camera, FastPlanConfig()
    where = (seen.field, map_for(seen, settings.occupancy), robot)
    planner, guard = build_safe_planner(planners.load("fast"), where, settings, None, config.noise, problem.terms)
    pilot = NavigationStack(
        planner,
        FastFilter(problem.field, robot, camera, robot.mount, config=config.filter),
        guard=guard,
        seen=problem.field,
        lasting=lasting,
    )
    contact = None if scene is None else world.contact_check(scene, robot.body)
    look = _pictures(problem, scene, camera)
    draws = world_generator(seed)
    simulator = Simulator(robot, problem.start, look, draws, robot.mount, noise=config.noise, contact=contact)
    mission = FlightRequest(problem.goal, problem.steps, problem.dt)
    events = navigate(mission, simulator, pilot, config, generator)
    return Episode.of([event for event in events if isinstance(event, NavigationStep)])


def update(
    estimator: Estimator,
    belief: Belief,
    image: UInt8[Tensor, "height width 3"] | None,
    action: Float[Tensor, " a"],
    dt: float,
    generator: torch.Generator,
) -> FilterResult:
    """Predict over an action of `dt` [s], and correct by the picture taken then (None: a dropped frame).

    Returns the posterior, its outcome, and the compared pixels. Raises InvalidInputError for a picture of another
    camera.
    """
    return run_steps(estimator.update(belief, image, action, dt, generator))


def _careful(problem: PlanProblem) -> PlanProblem:
    """The problem in the field with what no camera saw taken for solid."""
    return replace(problem, field=planning_field(problem.field, UnknownSpace.OCCUPIED))


def _pictures(problem: PlanProblem, scene: "world.Scene | None", camera: Camera) -> CameraFunction:
    """What photographs the scene, or else the field."""
    if scene is None:
        return lambda pose: render_image(problem.field, camera, pose).image
    renderer = world.MeshRenderer(scene, supersample=2)  # as the photographs that fields learn from
    return lambda pose: renderer.render(camera, pose).image
