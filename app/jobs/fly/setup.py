"""Set-up of a flight: planner, estimator and simulator that a request asks for, ready to navigate."""

from collections.abc import Generator
from dataclasses import replace

import torch

from nerfnav.estimator import estimators
from nerfnav.navigation import (
    WORLDS,
    Episode,
    FlightRequest,
    FlightStep,
    NavigationStack,
    Simulator,
    compensate_latency,
    navigate,
    world_generator,
)
from nerfnav.robots import Motion
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.fly.simulated_world import (
    camera_function,
    camera_of_movers,
    contact_function,
    hidden_by_movers,
    level_contact_function,
    warm_up_filter,
)
from nerfnav_app.jobs.plan.plan import configure_flight, make_planner, map_error_of
from nerfnav_app.places.derived import build_searcher
from nerfnav_app.places.place import Place


def begin(request: FlyRequest, plan: Motion | None, place: Place) -> Generator[FlightStep, None, Episode]:
    """Begin a flight by its first plan, or without one where no path was found, in a simulator of the place.

    Raises NerfnavError for unknown names.
    """
    route, robot, world = request.route, place.robot, WORLDS[request.route.world]
    estimator = estimators.load(request.estimator)
    flight = replace(route.flight, open_loop=request.open_loop or route.flight.open_loop)
    config = configure_flight(replace(route, flight=flight), place)
    planner, safety_filter = make_planner(route, place)
    stack = NavigationStack(
        planner,
        estimator.make(place.field, robot, robot.camera, mount=robot.mount, config=config.filter),
        build_searcher(place, robot.camera, config.filter.color_noise),
        safety_filter,
        place.field,
        map_error_of(place),
        hidden_by_movers(place),
    )
    simulator = world.simulate(Simulator(
        robot, route.ends.start.state(), camera_function(place), world_generator(request.seed), robot.mount,
        noise=config.noise, contact=contact_function(place), box=place.field.box,
        level_contact=level_contact_function(place), movers=place.movers, camera_at=camera_of_movers(place),
    ))  # fmt: skip
    stack = compensate_latency(stack, simulator)
    if request.realtime:  # the first update of a process takes seconds, for which no robot waits on the ground
        for _ in warm_up_filter(place, simulator.state):
            pass
    steps, dt = (route.steps, route.dt) if plan is None else (len(plan.actions), plan.dt)
    goal = route.ends.goal.state()
    flight = FlightRequest(goal, steps, dt, plan, request.operator, request.realtime)
    return navigate(flight, simulator, stack, config, torch.Generator().manual_seed(request.seed))
