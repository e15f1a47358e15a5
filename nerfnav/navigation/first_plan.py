"""First plan of a flight: the path, its duration, and headings in which the camera sees something.

`nerfnav plan`, the page and every flight make their first plan here, from the given start and with the planner of
flights (fallback.py), so that the plan that is shown is the one with which the flight begins. It does not depend on the
seed of a flight, which corrects it from the first belief.
"""

from collections.abc import Iterator
from dataclasses import replace

import torch

from nerfnav.geometry import so3
from nerfnav.navigation.flight import ActiveGoal
from nerfnav.navigation.looking import choose_route_headings
from nerfnav.planner import (
    FLYABLE,
    OccupancyMap,
    Planner,
    PlannerConfig,
    PlanOutcome,
    PlanProblem,
    PlanResult,
    PlanSteps,
    Route,
    SearchConfig,
    Timing,
    estimate_timing,
    find_shortest_plan,
    map_for,
    path_length,
    price_risk,
)
from nerfnav.planner.active_yaw import YawObjective
from nerfnav.robots import Motion, Robot, unwrap_angles, wrap_angle


def plan_first(
    planner: Planner, route: Route, robot: Robot, objective: YawObjective | None = None, timing: Timing | None = None
) -> PlanSteps:
    """Plan a route from scratch, then again with the headings that an objective of active yaw chooses.

    With a `timing`, the shortest duration is found that keeps the robot's limits, beginning with that estimate, in
    place of the route's.
    """
    if timing is None:
        planned = yield from planner.plan(route)
    else:
        timed = replace(route, dt=timing.dt)
        planned = yield from find_shortest_plan(
            lambda steps: planner.plan(replace(timed, steps=steps)), robot, timing.config
        )
    return (yield from _add_headings(planned, planner, robot, objective))


def may_choose_headings(planner: Planner) -> bool:
    """Check whether the planner keeps headings that were chosen for what the camera sees."""
    return getattr(planner, "keeps_headings", False)


def estimate_flight_time(
    problem: PlanProblem, occupancy: OccupancyMap, settings: PlannerConfig, longest_dt: float | None = None
) -> Timing:
    """Estimate the time that the best path of a problem takes, before it is planned.

    Its steps are as long as the problem's, or up to `longest_dt` [s] where there would be very many (see
    `estimate_timing`).
    """
    length = path_length(problem, map_for(problem, occupancy), _ways_of(settings))
    return estimate_timing(problem.robot, length, problem.dt, longest_dt)


def make_risk_maps(problem: PlanProblem, occupancy: OccupancyMap, settings: PlannerConfig) -> Iterator[None]:
    """Make the maps of risk on which plans of a problem search, step by step; they are kept for the plans."""
    yield from price_risk(problem, map_for(problem, occupancy), _ways_of(settings))
    yield


def _ways_of(settings: PlannerConfig) -> SearchConfig:
    """Return the settings of a planner's path search."""
    return getattr(settings, "ways", SearchConfig.single())


def _add_headings(planned: PlanResult, planner: Planner, robot: Robot, objective: YawObjective | None) -> PlanSteps:
    """Plan again with headings in which the camera sees something.

    The plan stays as it is where visibility does not count, where the planner does not keep headings, where the plan
    leads nowhere, and where it could be flown but the one with other headings could not, or takes longer.
    """
    motion, route = planned.motion, planned.trajectory.route
    leads = planned.outcome is not PlanOutcome.NO_PATH and bool(motion.states.position.isfinite().all())
    if objective is None or not leads or not may_choose_headings(planner):
        return planned
    goal, turned = choose_route_headings(ActiveGoal(route.goal), route.start, motion, objective, robot)
    yield planned.as_step()
    end = replace(route, goal=goal.plan_end, keeps_headings=goal.keeps_headings)
    if not goal.keeps_headings:
        turned = _turn_to_goal(motion, end, robot)
    found = yield from planner.replan(turned, end, executed=0)
    lasts_as_long = found.restart is None and len(found.motion.actions) == len(motion.actions)
    if not lasts_as_long or (planned.outcome in FLYABLE and found.outcome not in FLYABLE):
        return planned
    return replace(found, iteration=planned.iteration + 1 + found.iteration)


def _turn_to_goal(motion: Motion, route: Route, robot: Robot) -> Motion:
    """Turn evenly along a motion, beside the turns that it has, to the heading of the route's goal."""
    yaws, count = unwrap_angles(so3.yaw_of(motion.states.rotation)), len(motion.actions)
    more = wrap_angle(so3.yaw_of(route.goal.rotation) - yaws[-1])
    yaws = yaws + more * torch.arange(count + 1) / count
    waypoints = torch.cat([motion.states.position, yaws[:, None]], -1)
    free = robot.encode(waypoints, route.start, route.goal, route.dt)
    return robot.motion(free, route.start, route.goal, count, route.dt)
