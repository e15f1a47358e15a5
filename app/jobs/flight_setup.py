"""Set-up of a flight: planner, estimator and simulator that a request asks for, ready to navigate."""

from collections.abc import Iterator
from dataclasses import replace

import torch

from app.jobs.fly_request import FlyRequest
from app.jobs.plan import timing_for
from app.jobs.robot_camera import CAMERA
from app.jobs.simulated_world import camera_function, contact_function
from app.places.derived import occupancy_of, planning_place, searcher_of
from app.places.place import Place
from nerfnav.estimator import ColorNoise, FilterConfig, estimators
from nerfnav.navigation import LoopEvent, Mission, Pilot, Simulator, navigate
from nerfnav.navigation.backup import Guard
from nerfnav.planner import FieldPlanner, planners
from nerfnav.planner.spread import Disturbance


def begin(request: FlyRequest, place: Place) -> Iterator[LoopEvent]:
    """Yield the steps of a flight in a simulator of the place. Raises NerfnavError for unknown names."""
    route, seen_as = request.route, planning_place(place, request.route.unknown)
    estimator = estimators.load(request.estimator)
    occupancy = occupancy_of(seen_as, route.settings.occupancy, route.ends.start.position[2])
    entry = planners.load(route.planner)
    again = route.again or entry.again(route.settings)
    first = replace(route.settings, weights=replace(route.settings.weights, risk=again.weights.risk))
    planner = entry.planner(seen_as.field, place.robot, first, again, occupancy)
    config = replace(request.config, open_loop=request.open_loop or request.config.open_loop)
    pushed = Disturbance(config.noise.deviations)
    if isinstance(planner, FieldPlanner):
        planner = replace(planner, disturbance=pushed)
    config = replace(config, filter=_with_noise_of(config.filter, place))
    generator = torch.Generator().manual_seed(request.seed)
    pilot = Pilot(
        planner,
        estimator.make(place.field, place.robot, CAMERA, config=config.filter),
        searcher_of(place, CAMERA, config.filter.color_noise),
        Guard(seen_as.field, place.robot, pushed) if again.weights.risk else None,
    )
    camera, contact = camera_function(place), contact_function(place)
    simulator = Simulator(
        place.robot, route.ends.start.state(), camera, generator, noise=config.noise, contact=contact
    )
    mission = Mission(route.ends.goal.state(), route.steps, route.dt, request.plan, request.orders)
    return navigate(mission, simulator, pilot, config, generator)


def timed(request: FlyRequest, place: Place) -> FlyRequest:
    """The same with the number of steps that its plan has, or, where a duration is to be found, its way should take."""
    route, plan = request.route, request.plan
    if plan is not None:
        return replace(request, route=replace(route, steps=plan.actions.shape[-2], dt=plan.dt))
    if not route.shortest:
        return request
    seen_as = planning_place(place, route.unknown)
    occupancy = occupancy_of(seen_as, route.settings.occupancy, route.ends.start.position[2])
    timing = timing_for(route, seen_as, occupancy, keep_dt=True)  # the loop looks around at each step
    return replace(request, route=replace(route, steps=timing.steps, dt=timing.dt))


def _with_noise_of(config: FilterConfig, place: Place) -> FilterConfig:
    """The colour noise that was measured for this field, unless another was asked for."""
    asked = config.color_noise.std != ColorNoise.std
    return config if asked else config.for_field(place.field.info.noise_std)
