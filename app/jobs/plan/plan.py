"""Plan: from a start and a goal to a trajectory through the field, judged on the mesh; and the request of one."""

import time
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from pathlib import Path

from nerfnav.core.errors import InvalidInputError, OccupiedError, require_positive, require_probability, require_share
from nerfnav.core.steps import map_steps
from nerfnav.estimator import ColorNoise, ConsiderCovariance
from nerfnav.field import UnknownSpace
from nerfnav.navigation import (
    WORLDS,
    ExpectedSigma,
    NavigateConfig,
    SafetyFilter,
    WorldName,
    build_safe_planner,
    can_expect,
    estimate_flight_time,
    expect_sigma_in_steps,
    make_risk_maps,
    make_yaw_objective,
    plan_first,
)
from nerfnav.planner import (
    FLYABLE,
    FastPlanConfig,
    FieldPlanner,
    InteractivePlanner,
    OccupancyMap,
    Planner,
    PlannerConfig,
    PlanOutcome,
    PlanProblem,
    PlanResult,
    PlanStep,
    PlanSteps,
    Route,
    collision_probability,
    enforce_chance_constraint,
    planners,
)
from nerfnav.robots import Motion, NoiseModel
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.plan.report import PlanRisk, mesh_overlap_m3, save, summary_of
from nerfnav_app.places.derived import (
    build_occupancy,
    expect_noise_in,
    explain_unfit_in,
    planning_robot,
    prepare_route,
)
from nerfnav_app.places.ends import EndRole, Ends
from nerfnav_app.places.ground import describe_move, put_on_ground
from nerfnav_app.places.obstacles import put_down
from nerfnav_app.places.place import Place
from nerfnav_app.storage.output_files import prepare_folder


@dataclass(frozen=True)
class PlanRequest:
    """Request of a plan: start, goal, time steps and planner."""

    ends: Ends
    """Start and goal; the robot comes to rest at the goal."""
    steps: int = 20
    """Number of time steps."""
    dt: float = 0.1
    """Length of a step [s]."""
    planner: str = "fast"
    """Name of the planner."""
    config: PlannerConfig | None = None
    """Its settings; None: its own."""
    again: PlannerConfig | None = None
    """Its settings when it replans in flight; None: the above with the risk of noise, or with room for it, or by the
    paper's cost the above. Their weight of risk is that of the first plan too."""
    paper_cost: bool = False
    """Minimise the paper's Eq. 2 alone: no noise model, no room for noise, no choice of headings."""
    flight: NavigateConfig = field(default_factory=NavigateConfig)
    """Configuration of the flight that the plan is for, its noise among it."""
    world: WorldName = "paper"
    """World of that flight: the paper's noise, or the physical one, which has no use for the noise of `flight`."""
    keep_dt: bool = False
    """Keep this length of steps where a duration is found, however many they are."""
    shortest: bool = False
    """Find the shortest duration that keeps the robot's limits, in place of `steps`."""
    max_collision: float | None = None
    """Largest probability of a collision that is accepted: of a flight in noise, or by the paper's cost the bound of
    Eq. 1; None accepts any."""
    max_blind: float | None = None
    """Largest share of the plan with too little to see that is accepted, 0 to 1; None accepts any."""
    unknown: UnknownSpace = UnknownSpace.OCCUPIED
    """State of space that no camera saw into, for planners."""
    watch: bool = False
    """True: the robot looks for movers in its pictures, with its headings along the way."""
    draft: bool = False
    """Whether to plan as quickly as possible, without the verdict and the numbers of the job."""
    warm_start: Motion | None = None
    """Last plan, with which a draft begins, and from which it takes its speed where a duration is to be found."""
    out: Path | None = None
    """Folder for trajectory.csv, trajectory.json and plan.json; None writes nothing."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no plan can have."""
        require_positive(steps=self.steps, dt=self.dt, iterations=self.settings.iterations)
        require_probability(max_collision=self.max_collision)
        require_share(max_blind=self.max_blind)

    @property
    def settings(self) -> PlannerConfig:
        """Settings of the planner. Raises NerfnavError for an unknown planner, or settings of another one."""
        own = planners.load(self.planner).config()
        for given in (self.config, self.again):
            if given is not None and type(given) is not type(own):
                raise InvalidInputError(f"these settings are not those of the planner {self.planner!r}: leave them out")
        return own if self.config is None else self.config

    @property
    def flight_settings(self) -> PlannerConfig:
        """Settings with the weight of risk that the plans of a flight have."""
        return planners.load(self.planner).first_in_flight(self.settings, self.replan_settings)

    @property
    def height(self) -> float:
        """Height of the start [m], which a robot on the ground keeps."""
        return self.ends.start.position[2]

    @property
    def navigate_config(self) -> NavigateConfig:
        """Configuration of the flight; by the paper's cost no heading is chosen for what the camera sees."""
        return replace(self.flight, in_sight=0.0) if self.paper_cost else self.flight

    @property
    def replan_settings(self) -> PlannerConfig | None:
        """Settings with which the planner replans in flight; None: the planner's own."""
        return self.settings if self.again is None and self.paper_cost else self.again

    def lasting(self, seconds: float) -> "PlanRequest":
        """The same in a given time [s], cut into whole steps of about dt. Raises InvalidInputError for none."""
        require_positive(duration=seconds)
        steps = max(1, round(seconds / self.dt))
        return replace(self, steps=steps, dt=seconds / steps)


def run(request: PlanRequest, place: Place) -> JobEvents:
    """Yield every iteration of the planner; return the numbers of the last one and what was written.

    The ends of a robot on the ground are put on the floor first. Raises NerfnavError where the request cannot be worked
    with.
    """
    given, request = request.ends, replace(request, ends=put_on_ground(place, request.ends, request.unknown))
    planning = prepare_route(place, request.unknown, request.height)
    flight = configure_flight(request, place)
    out = None if request.out is None else prepare_folder(request.out)
    yield Progress("finding a way", 0.0)
    steps, planned, worked_s, iterations = plan_steps(request, place), None, 0.0, request.settings.iterations
    while planned is None:
        began = time.perf_counter()
        try:
            step = next(steps)
        except StopIteration as end:
            step = planned = end.value
        worked_s += time.perf_counter() - began
        if step is None:
            yield Progress("finding a way", 0.0)
            continue
        yield step
        yield Progress("optimising", min(1.0, (step.iteration + 1) / iterations))
    if request.draft:
        return JobResult()
    yield Progress("judging", 1.0)
    overlap = mesh_overlap_m3(place, planned.motion)
    if overlap and planned.outcome in FLYABLE:
        planned = replace(planned, outcome=PlanOutcome.TOUCHES_MESH)
        yield planned
    # again and again, so that the page can drop it where a hand begins to drag
    judging = Progress("judging", 1.0)
    expected = yield from map_steps(_expect_sigma(planned.motion, request, flight, place), lambda _: judging)
    blind = flight.most_blind is not None and expected is not None and expected.blind_share > flight.most_blind
    if blind and planned.outcome in FLYABLE:
        planned = replace(planned, outcome=PlanOutcome.TOO_RISKY)
        yield planned
    yield Progress("judging", 1.0)
    summary = summary_of(planned, planning, worked_s, overlap, _risk_of(planned.motion, request, place), expected)
    summary |= describe_move(given, request.ends)
    return JobResult(summary, () if out is None else save(out, planned.motion, planning, summary, request.unknown))


def _risk_of(motion: Motion, request: PlanRequest, place: Place) -> PlanRisk:
    """Estimate the risk of a flight of the request by its plan."""
    field = prepare_route(place, request.unknown, request.height).field
    noise, robot = noise_of(request, place), planning_robot(place.robot, request.world)
    probability = collision_probability(
        field, robot, motion, noise, request.flight.goal_tolerance_m, movers=place.announced_movers
    )
    return PlanRisk(probability, request.flight_settings.weights.risk, request.max_collision)


def _expect_sigma(
    motion: Motion, request: PlanRequest, flight: NavigateConfig, place: Place
) -> Generator[None, None, ExpectedSigma | None]:
    """Expect what the views along a plan will tell; None also in the physical world, whose robots fly by an inertial
    unit as well."""
    if request.world != "paper":
        return None
    return (yield from expect_sigma_in_steps(motion, place.robot, place.field, flight, map_error_of(place)))


def configure_flight(request: PlanRequest, place: Place) -> NavigateConfig:
    """Configure the flight of a request for its world, its field, and the risk that it accepts.

    Raises InvalidInputError where the request limits what cannot be expected.
    """
    config = WORLDS[request.world].configure(request.navigate_config)
    if request.max_blind is not None and (request.world != "paper" or config.open_loop or not can_expect(place.field)):
        raise InvalidInputError(
            "what the camera will see counts in the paper's world, by camera, in fields on a grid: "
            "bake the field, or leave out --max-blind"
        )
    known = config.filter.for_field(place.field.info)
    if config.filter.color_noise.std != ColorNoise.std:  # which was set by hand
        known = replace(known, color_noise=config.filter.color_noise)
    most_risk = config.most_risk if request.max_collision is None else request.max_collision
    most_blind = config.most_blind if request.max_blind is None else request.max_blind
    return replace(config, filter=known, most_risk=most_risk, most_blind=most_blind)


def map_error_of(place: Place) -> ConsiderCovariance:
    """Return the map error of a place for its robot; none where the field itself is what the camera sees."""
    return ConsiderCovariance(() if place.scene is None else place.field.info.pose_floor, place.robot.mount)


def make_planner(
    request: PlanRequest, place: Place, occupancy: OccupancyMap | None = None
) -> tuple[Planner, SafetyFilter | None]:
    """Make the planner of the request's flight, which makes its first plan too, and the safety filter.

    It searches on the `occupancy` map, where others search too; None: on one of its own.
    """
    planning = prepare_route(place, request.unknown, request.height)
    return build_safe_planner(
        planners.load(request.planner), planning.field, occupancy or _map_for(request, place),
        planning_robot(place.robot, request.world), request.settings, noise_of(request, place),
        request.replan_settings, movers=place.announced_movers,
    )  # fmt: skip


def noise_of(request: PlanRequest, place: Place) -> NoiseModel:
    """Return the noise of the request's flight, as its plans allow for it."""
    config = configure_flight(request, place)
    if not request.flight_settings.weights.risk:
        return NoiseModel(config.noise)
    return expect_noise_in(place, config, request.world, request.unknown, request.settings.occupancy, request.height)


def plan_steps(request: PlanRequest, place: Place) -> Generator[PlanStep | None, None, PlanResult]:
    """Plan as often as the request needs: for the duration, for what the camera sees, for the bound on collisions.

    This is the first plan of a flight by the same request. Its ends are on the floor already, as both jobs see to it.
    Yields None between the maps that are made first, each of which may take a second.
    """
    try:
        if request.draft:
            return (yield from _draft_in(request, place))
        prepared = yield from _prepare(request, place)
        return (yield from _plan_prepared(request, place, prepared))
    except OccupiedError as error:
        state = request.ends.of(EndRole(error.name)).state()
        raise error.because(explain_unfit_in(place, state, request.unknown)) from error


@dataclass(frozen=True)
class _Prepared:
    """Inputs of the plan of a request; the maps that they lead to are made and kept."""

    problem: PlanProblem
    """Problem, by the request's duration."""
    occupancy: OccupancyMap
    """Map of its searches."""
    planner: Planner
    """Planner of the request's flight."""


def _prepare(request: PlanRequest, place: Place) -> Generator[None, None, _Prepared]:
    planning, robot = prepare_route(place, request.unknown, request.height), planning_robot(place.robot, request.world)
    occupancy = _map_for(request, place)
    yield
    problem = PlanProblem(
        planning.field, robot, request.ends.start.state(), request.ends.goal.state(), request.steps, request.dt,
        noise=noise_of(request, place), movers=place.announced_movers,
    )  # fmt: skip
    yield
    yield from make_risk_maps(problem, occupancy, request.flight_settings)
    planner, _ = make_planner(request, place, occupancy)
    return _Prepared(problem, occupancy, planner)


def _plan_prepared(request: PlanRequest, place: Place, prepared: _Prepared) -> PlanSteps:
    problem, settings = prepared.problem, request.flight_settings
    objective = make_yaw_objective(
        place.field, problem.field, problem.robot, place.robot.mount, request.navigate_config.in_sight, request.watch
    )
    timing = None
    if request.shortest:
        longest_dt = request.dt if request.keep_dt else None
        timing = estimate_flight_time(problem, prepared.occupancy, settings, longest_dt)
    planned = yield from plan_first(prepared.planner, problem.route, problem.robot, objective, timing)
    if request.max_collision is None:
        return planned
    end = planned.trajectory.route  # whose heading may have been chosen for what the camera sees
    problem = replace(problem, goal=end.goal, steps=end.steps, dt=end.dt, keeps_headings=end.keeps_headings)
    # unlike plans of other durations, this one weighs risk anew: it searches anew, too
    planning = prepare_route(place, request.unknown, request.height)
    occupancy = build_occupancy(planning, request.settings.occupancy, request.height)
    careful = FastPlanConfig(weights=settings.weights, occupancy=settings.occupancy)
    most, tolerance = request.max_collision, request.flight.goal_tolerance_m
    return (yield from enforce_chance_constraint(problem, planned, careful, most, occupancy, tolerance))


def _map_for(request: PlanRequest, place: Place) -> OccupancyMap:
    """Return the map of the request's searches, which remembers the last one."""
    planning = prepare_route(place, request.unknown, request.height)
    return build_occupancy(planning, request.settings.occupancy, request.height).remembering()


def _draft_in(request: PlanRequest, place: Place) -> PlanSteps:
    """Plan a draft; among obstacles at first on the map without them, which is there already: where the last plan can
    be bent around them, no path is searched."""
    if place.bare is not None and request.warm_start is not None:
        planner, _ = make_planner(request, place, _map_for(request, place.without_obstacles()))
        try:
            found = yield from _draft(request, planner)
        except OccupiedError:  # an obstacle stands on an end, which the map of all obstacles explains
            pass
        else:
            if found.outcome in (*FLYABLE, PlanOutcome.OVER_LIMITS):
                return found
    place = put_down(place)
    planner, _ = make_planner(request, place, _map_for(request, place))
    return (yield from _draft(request, planner))


def _draft(request: PlanRequest, planner: Planner) -> PlanSteps:
    """Plan once, from the warm start where there is one and the planner can use it."""
    last, steps, dt = request.warm_start, request.steps, request.dt
    if isinstance(planner, FieldPlanner):
        planner = replace(planner, risk_dt=dt)  # one collision map for all moves of the hand
    start, goal = request.ends.start.state(), request.ends.goal.state()
    if last is None:
        return planner.plan(Route(start, goal, steps, dt))
    if request.shortest:
        steps, dt = len(last.actions), last.dt * _stretch(last, request.ends)
    route = Route(start, goal, steps, dt)
    interactive = isinstance(planner, InteractivePlanner)
    return planner.replan_moved_ends(last, route) if interactive else planner.plan(route)


def _stretch(last: Motion, ends: Ends) -> float:
    """Ratio of the distance between the ends now and in the last plan, within a factor of two."""
    before = (last.states.position[-1] - last.states.position[0]).norm().item()
    now = (ends.goal.state().position - ends.start.state().position).norm().item()
    return min(max(now / max(before, 1e-3), 0.5), 2.0)
