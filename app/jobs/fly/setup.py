"""Set-up of a flight: planner, estimator and simulator that a request asks for, ready to navigate."""

from collections.abc import Generator
from dataclasses import replace

import torch

from nerfnav.estimator import ColorNoise, ConsiderCovariance, FilterConfig, estimators
from nerfnav.navigation import (
    WORLDS,
    Episode,
    FlightRequest,
    FlightStep,
    NavigationStack,
    Simulator,
    build_safe_planner,
    compensate_latency,
    navigate,
    world_generator,
)
from nerfnav.planner import planners
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.fly.simulated_world import camera_function, contact_function, warm_up_filter
from nerfnav_app.jobs.plan.plan import timing_for
from nerfnav_app.places.derived import build_occupancy, build_searcher, prepare_place
from nerfnav_app.places.place import Place


def begin(request: FlyRequest, place: Place) -> Generator[FlightStep, None, Episode]:
    """Begin a flight in a simulator of the place. Raises NerfnavError for unknown names."""
    route, planned = request.route, prepare_place(place, request.route.unknown)
    robot, world = place.robot, WORLDS[request.world]
    estimator = estimators.load(request.estimator)
    occupancy = build_occupancy(planned, route.settings.occupancy, route.ends.start.position[2])
    config = world.configure(replace(request.config, open_loop=request.open_loop or request.config.open_loop))
    planner, safety_filter = build_safe_planner(
        planners.load(route.planner), planned.field, occupancy, world.planning_robot(robot), route.settings,
        config.noise, route.again,
    )  # fmt: skip
    config = replace(config, filter=_configure_filter(config.filter, place))
    stack = NavigationStack(
        planner,
        estimator.make(place.field, robot, robot.camera, mount=robot.mount, config=config.filter),
        build_searcher(place, robot.camera, config.filter.color_noise),
        safety_filter,
        place.field,
        ConsiderCovariance(() if place.scene is None else place.field.info.pose_floor, robot.mount),
    )
    simulator = world.simulate(Simulator(
        robot, route.ends.start.state(), camera_function(place), world_generator(request.seed), robot.mount,
        noise=config.noise, contact=contact_function(place),
    ))  # fmt: skip
    stack = compensate_latency(stack, simulator)
    if request.realtime:  # the first update of a process takes seconds, for which no robot waits on the ground
        for _ in warm_up_filter(place, simulator.state):
            pass
    flight = FlightRequest(
        route.ends.goal.state(), route.steps, route.dt, request.plan, request.operator, request.realtime
    )
    return navigate(flight, simulator, stack, config, torch.Generator().manual_seed(request.seed))


def set_duration(request: FlyRequest, place: Place) -> FlyRequest:
    """Set the number of steps to that of the first plan, or, where a duration is to be found, estimate it."""
    route, plan = request.route, request.plan
    if plan is not None:
        return replace(request, route=replace(route, steps=plan.actions.shape[-2], dt=plan.dt))
    if not route.shortest:
        return request
    planned = prepare_place(place, route.unknown)
    occupancy = build_occupancy(planned, route.settings.occupancy, route.ends.start.position[2])
    planned = replace(planned, robot=WORLDS[request.world].planning_robot(place.robot))
    settings = route.again or planners.load(route.planner).again(route.settings)  # with the risk that flights count
    # the loop looks around at each step: their length stays
    timing = timing_for(replace(route, config=settings), planned, occupancy, keep_dt=True)
    return replace(request, route=replace(route, steps=timing.steps, dt=timing.dt))


def _configure_filter(config: FilterConfig, place: Place) -> FilterConfig:
    """Take the noise that was measured for this field; keep a colour noise that is not the default."""
    measured = config.for_field(place.field.info)
    return measured if config.color_noise.std == ColorNoise.std else replace(measured, color_noise=config.color_noise)
