"""Plan, fly and filter in one call each, with the settings of `nerfnav plan` and `nerfnav fly`.

For every iteration, use the generators that these run to their end: `nerfnav.navigation.plan_first`,
`nerfnav.navigation.navigate` and `Estimator.update`.
"""

from dataclasses import replace
from typing import Literal

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

import nerfnav.world as world  # loaded at its first use, which takes half a second that no plan needs
from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief, ConsiderCovariance, Estimator, FastFilter, FilterResult
from nerfnav.field import GridField, UnknownSpace, planning_field, render_image
from nerfnav.geometry import Camera
from nerfnav.navigation import (
    LEVEL,
    WORLDS,
    CameraFunction,
    Episode,
    FlightRequest,
    Gyroscopes,
    NavigateConfig,
    NavigationStack,
    Simulator,
    build_safe_planner,
    estimate_flight_time,
    expect_noise,
    make_yaw_objective,
    navigate,
    plan_first,
    use_inertial_unit,
    world_generator,
)
from nerfnav.planner import (
    FastPlanConfig,
    FastPlanner,
    PlanProblem,
    PlanResult,
    close_holes,
    map_for,
    planners,
    with_risk,
)
from nerfnav.robots import PAPER_NOISE


def plan(
    problem: PlanProblem, config: FastPlanConfig | None = None, duration: Literal["auto"] | None = None
) -> PlanResult:
    """Plan the trajectory with which `fly` begins, by the fast planner.

    By default it minimises paper Eq. 2 with the risk of the problem's noise (where that is the paper's, with the error
    of the estimate that the field's pictures leave), and turns to where the robot's camera sees something.
    With a `config` it minimises J by the weights of that alone: `FastPlanConfig()` is paper Eq. 2.

    The problem gives the duration, by default the paper's 2 s. With the duration "auto", the shortest plan is found
    that keeps the robot's limits (see planner/solvers/duration.py), as places of other sizes need it. Space that no
    camera saw counts as solid. Raises InvalidInputError, OutsideBoxError or OccupiedError for ends that cannot be
    planned between; check `outcome` before you fly the result.
    """
    seen, problem, robot = problem.field, _with_solid_unknown(problem), problem.robot
    settings, objective = config, None
    if settings is None:
        settings = with_risk(FastPlanConfig())
        objective = make_yaw_objective(seen, problem.field, robot, robot.mount, NavigateConfig.in_sight)
    occupancy = map_for(problem, settings.occupancy).remembering()
    noise = problem.noise
    if settings.weights.risk and noise == PAPER_NOISE:
        noise = expect_noise(seen, occupancy, robot, NavigateConfig().in_field(seen))
    planner = FastPlanner(
        problem.field, robot, settings, settings, occupancy=occupancy, terms=problem.terms, noise=noise
    )
    timing = None if duration is None else estimate_flight_time(problem, occupancy, settings)
    return run_steps(plan_first(planner, problem.route, robot, objective, timing))


def fly(
    problem: PlanProblem,
    scene: "world.Scene | None" = None,
    camera: Camera | None = None,
    config: NavigateConfig | None = None,
    seed: int = 0,
) -> Episode:
    """Simulate a flight by Algorithm 1 of the paper: plan, act, look, correct and replan until the goal.

    With a `scene` the camera (by default the robot's own) photographs its mesh, and the episode says where the body
    touched it, which ends the flight unless `config.fly_on`; without one it photographs the field itself, and contacts
    are not judged. The same `seed` gives the same noise. Raises as `plan` does.
    """
    config, settings = WORLDS["paper"].configure((config or NavigateConfig()).in_field(problem.field)), FastPlanConfig()
    planned, robot, map_error = _with_solid_unknown(problem), problem.robot, ConsiderCovariance()
    if isinstance(problem.field, GridField):
        map_error = map_error if scene is None else ConsiderCovariance(problem.field.info.pose_floor, robot.mount)
    camera, entry = camera or robot.camera, planners.load("fast")
    occupancy = map_for(planned, settings.occupancy)
    planner, safety_filter = build_safe_planner(
        entry, planned.field, occupancy, robot, settings, expect_noise(problem.field, occupancy, robot, config),
        terms=problem.terms,
    )
    stack = NavigationStack(
        planner,
        FastFilter(problem.field, robot, camera, robot.mount, config=config.filter),
        safety_filter=safety_filter,
        camera_field=problem.field,
        map_error=map_error,
    )
    simulator = Simulator(
        robot,
        problem.start,
        _camera_function(problem, scene, camera),
        world_generator(seed),
        robot.mount,
        noise=config.noise,
        contact=None if scene is None else world.contact_check(scene, robot.body),
        box=problem.field.box,
        level_contact=None if scene is None else world.level_contact_check(scene, robot.body, LEVEL),
        gyroscopes=Gyroscopes(seed) if config.imu else None,
    )
    stack = use_inertial_unit(stack, simulator)
    request = FlightRequest(problem.goal, problem.steps, problem.dt)
    return run_steps(navigate(request, simulator, stack, config, torch.Generator().manual_seed(seed)))


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


def _with_solid_unknown(problem: PlanProblem) -> PlanProblem:
    """Return the problem in the field in which unseen space is solid, and holes are where the robot drives."""
    field = planning_field(problem.field, UnknownSpace.OCCUPIED)
    return replace(problem, field=close_holes(field, problem.robot, problem.start.position[2].item()))


def _camera_function(problem: PlanProblem, scene: "world.Scene | None", camera: Camera) -> CameraFunction:
    """Photograph the scene, or else the field."""
    if scene is None:
        return lambda pose: render_image(problem.field, camera, pose).image
    renderer = world.MeshRenderer(scene, supersample=2)  # as the photographs that fields learn from
    return lambda pose: renderer.render(camera, pose).image
