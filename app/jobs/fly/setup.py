"""Set-up of a flight: planner, estimator and simulator that a request asks for, ready to navigate."""

from collections.abc import Generator
from dataclasses import dataclass, replace

import torch

from nerfnav.estimator import estimators
from nerfnav.navigation import (
    WORLDS,
    Episode,
    FlightRequest,
    FlightStep,
    Gyroscopes,
    NavigateConfig,
    NavigationStack,
    OperatorRequests,
    Simulator,
    Watch,
    navigate,
    use_inertial_unit,
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
    flight = replace(route.flight, open_loop=request.open_loop or route.flight.open_loop)
    config = configure_flight(replace(route, flight=flight), place)
    simulator = world.simulate(Simulator(
        robot, route.ends.start.state(), camera_function(place), world_generator(request.seed), robot.mount,
        noise=config.noise, contact=contact_function(place), box=place.field.box,
        level_contact=level_contact_function(place), movers=place.movers, camera_at=camera_of_movers(place),
        gyroscopes=Gyroscopes(request.seed) if config.imu else None,
    ))  # fmt: skip
    stack = _make_stack(request, config, place)
    stack = use_inertial_unit(stack, simulator)
    if request.realtime:  # the first update of a process takes seconds, for which no robot waits on the ground
        for _ in warm_up_filter(place, simulator.state):
            pass
    steps, dt = (route.steps, route.dt) if plan is None else (len(plan.actions), plan.dt)
    goal = route.ends.goal.state()
    operator = _Surroundings(request, config, place, simulator, stack)
    flight = FlightRequest(goal, steps, dt, plan, operator, request.realtime)
    return navigate(flight, simulator, stack, config, torch.Generator().manual_seed(request.seed))


def _make_stack(request: FlyRequest, config: NavigateConfig, place: Place) -> NavigationStack:
    """Join planner, estimator and global localization in the field of a place."""
    robot, estimator = place.robot, estimators.load(request.estimator)
    planner, safety_filter = make_planner(request.route, place)
    return NavigationStack(
        planner,
        estimator.make(place.field, robot, robot.camera, mount=robot.mount, config=config.filter),
        build_searcher(place, robot.camera, config.filter.color_noise),
        safety_filter,
        place.field,
        map_error_of(place),
        hidden_by_movers(place),
        Watch.of(place.field, robot) if request.route.watch else None,
    )


@dataclass
class _Surroundings:
    """Operator of a flight that has camera, contact and stack of the place as it is, with its obstacles.

    Global localization looks in the place as it was at the start.
    """

    request: FlyRequest
    config: NavigateConfig
    place: Place
    simulator: Simulator
    stack: NavigationStack

    def __call__(self) -> OperatorRequests:
        """Take the requests for the next time step."""
        requests = self.request.operator()
        place = self.place if self.request.surroundings is None else self.request.surroundings()
        if place.obstacles == self.place.obstacles:
            return requests
        self.place, simulator = place, self.simulator
        simulator.camera, simulator.contact = camera_function(place), contact_function(place)
        simulator.level_contact = level_contact_function(place)
        simulator.movers, simulator.camera_at = place.movers, camera_of_movers(place)
        stack = replace(_make_stack(self.request, self.config, place), relocaliser=self.stack.relocaliser)
        self.stack = use_inertial_unit(stack, simulator, self.stack)
        return replace(requests, stack=self.stack)
