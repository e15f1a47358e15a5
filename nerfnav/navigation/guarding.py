"""Planner and guard of a robot that will be pushed: what a flight plans with."""

from dataclasses import replace

from nerfnav.estimator import StateNoise
from nerfnav.field import Field
from nerfnav.navigation.backup import Guard
from nerfnav.planner import CostTerm, Disturbance, FieldPlanner, OccupancyMap, Planner, PlannerConfig, PlannerEntry
from nerfnav.robots import Robot


def guarded(
    entry: PlannerEntry,
    where: tuple[Field, OccupancyMap, Robot],
    settings: PlannerConfig,
    again: PlannerConfig | None,
    noise: StateNoise,
    terms: tuple[CostTerm, ...] | None = None,
) -> tuple[Planner, Guard | None]:
    """The planner of `entry` for the field as planners see it, its map and a robot, and what keeps a backup ready.

    The first plan counts as much risk as those `again` do (None: as the entry has them); where they count none, there
    is no backup. `noise` is what pushes the robot at each step; `terms` are what J is the sum of, None: all that
    are registered.
    """
    field, occupancy, robot = where
    again = again or entry.again(settings)
    risk, pushed = again.weights.risk, Disturbance(noise.deviations)
    first = replace(settings, weights=replace(settings.weights, risk=risk))
    planner = entry.planner(field, robot, first, again, occupancy)
    if isinstance(planner, FieldPlanner):
        planner = replace(planner, disturbance=pushed, terms=planner.terms if terms is None else terms)
    return planner, Guard(field, robot, pushed) if risk else None
