"""Set-up of a flight: planner, estimator and simulator that a request asks for, ready to navigate."""

from collections.abc import Iterator
from dataclasses import replace

import torch

from nerfnav.estimator import ColorNoise, ConsiderCovariance, FilterConfig, estimators
from nerfnav.navigation import (
    WORLDS,
    FlightRequest,
    LoopEvent,
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


def begin(request: FlyRequest, place: Place) -> Iterator[LoopEvent]:
    """Yield the steps of a flight in a simulator of the place. Raises NerfnavError for unknown names."""
    route, seen_as = request.route, prepare_place(place, request.route.unknown)
    robot, seen_with, world = place.robot, place.robot.camera, WORLDS[request.world]
    estimator = estimators.load(request.estimator)
    occupancy = build_occupancy(seen_as, route.settings.occupancy, route.ends.start.position[2])
    config = replace(request.config, open_loop=request.open_loop or request.config.open_loop)
    config = world.expecting(config)
    where = seen_as.field, occupancy, world.planned(robot)
    planner, guard = build_safe_planner(planners.load(route.planner), where, route.settings, route.again, config.noise)
    config = replace(config, filter=_suiting(config.filter, place))
    generator = torch.Generator().manual_seed(request.seed)
    lasting = ConsiderCovariance(() if place.scene is None else place.field.info.pose_floor, robot.mount)
    pilot = NavigationStack(
        planner,
        estimator.make(place.field, robot, seen_with, mount=robot.mount, config=config.filter),
        build_searcher(place, seen_with, config.filter.color_noise),
        guard,
        place.field,
        lasting,
    )
    camera, contact = camera_function(place), contact_function(place)
    simulator = world.simulated(Simulator(
        robot, route.ends.start.state(), camera, world_generator(request.seed), robot.mount,
        noise=config.noise, contact=contact,
    ))  # fmt: skip
    pilot = compensate_latency(pilot, simulator)
    goal = route.ends.goal.state()
    if request.realtime:  # the first update of a process takes seconds, which no robot waits for on the ground
        for _ in warm_up_filter(place, simulator.state):
            pass
    mission = FlightRequest(goal, route.steps, route.dt, request.plan, request.orders, request.realtime)
    return navigate(mission, simulator, pilot, config, generator)


def set_duration(request: FlyRequest, place: Place) -> FlyRequest:
    """The same with the number of steps that its plan has, or, where a duration is to be found, its way should take."""
    route, plan = request.route, request.plan
    if plan is not None:
        return replace(request, route=replace(route, steps=plan.actions.shape[-2], dt=plan.dt))
    if not route.shortest:
        return request
    seen_as = prepare_place(place, route.unknown)
    occupancy = build_occupancy(seen_as, route.settings.occupancy, route.ends.start.position[2])
    seen_as = replace(seen_as, robot=WORLDS[request.world].planned(place.robot))
    settings = route.again or planners.load(route.planner).again(route.settings)  # with the risk that flights count
    asked = replace(route, config=settings)
    timing = timing_for(asked, seen_as, occupancy, keep_dt=True)  # the loop looks around at each step
    return replace(request, route=replace(route, steps=timing.steps, dt=timing.dt))


def _suiting(config: FilterConfig, place: Place) -> FilterConfig:
    """The filter with what was measured for this field; its colour noise only where no other was asked for."""
    measured = config.for_field(place.field.info)
    asked = config.color_noise.std != ColorNoise.std
    return replace(measured, color_noise=config.color_noise) if asked else measured
