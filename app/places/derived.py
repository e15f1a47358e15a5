"""Derived data of a place, cached: the field as planners see it, its occupancy map, its searcher."""

from dataclasses import replace
from functools import lru_cache

from nerfnav.estimator import ColorNoise, GlobalLocalizer, RelocaliseConfig
from nerfnav.field import UnknownSpace, describe_unproven, planning_field
from nerfnav.geometry import Camera
from nerfnav.navigation import WORLDS, NavigateConfig, WorldName, expect_noise
from nerfnav.planner import OccupancyConfig, OccupancyMap, close_holes, explain_unfit, fits
from nerfnav.robots import NoiseModel, RigidState, Robot
from nerfnav_app.places.place import Place


def prepare_place(place: Place, unknown: UnknownSpace) -> Place:
    """The place as planners see it, its unknown space taken for solid or not; made once for a field, as maps are."""
    field = planning_field(place.field, unknown)
    return place if field is place.field else replace(place, field=field)


def prepare_route(place: Place, unknown: UnknownSpace, height: float) -> Place:
    """The place as planners see it, with the holes of its floor closed for a robot that drives at a height [m]."""
    planning = prepare_place(place, unknown)
    field = _close_holes(planning.field, place.robot, height)
    return planning if field is planning.field else replace(planning, field=field)


def build_occupancy(place: Place, config: OccupancyConfig, height: float) -> OccupancyMap:
    """The map that paths are searched on: of one height [m] for a robot that never leaves it, else of the place."""
    return _map_of(place.field, place.robot.body, config, height if place.robot.planar else None)


def expect_noise_in(
    place: Place, config: NavigateConfig, world: WorldName, unknown: UnknownSpace, maps: OccupancyConfig, height: float
) -> NoiseModel:
    """The noise of flights in a place, as plans allow for it: the same whatever obstacles are in it, so that maps of
    chances are made once; in the physical world, whose robots have an inertial unit, the default."""
    if world != "paper":
        return NoiseModel(config.noise)
    bare = place.without_obstacles()
    occupancy = build_occupancy(prepare_route(bare, unknown, height), maps, height)
    return expect_noise(bare.field, occupancy, planning_robot(place.robot, world), config)


_close_holes = lru_cache(maxsize=2)(close_holes)
_map_of = lru_cache(maxsize=4)(OccupancyMap.of)
"""Made once, for it takes longer than most searches."""


@lru_cache(maxsize=4)
def planning_robot(robot: Robot, world: WorldName) -> Robot:
    """The robot as planners take it in a world; one object for each, by which maps of chances know it again."""
    return WORLDS[world].planning_robot(robot)


def explain_unfit_in(place: Place, state: RigidState, unknown: UnknownSpace) -> str:
    """Explain in words why the place's robot does not fit at a state, to go on after the name of the state; unproven
    space is named where that alone keeps the robot from it."""
    body, planned = place.robot.body, prepare_place(place, unknown).field
    as_it_says = prepare_place(place, UnknownSpace.FREE).field
    if not fits(planned, body, state) and fits(as_it_says, body, state):
        return "is in unproven space"
    return explain_unfit(planned, body, state)


@lru_cache(maxsize=1)
def describe_unproven_in(place: Place) -> str:
    """Describe the unproven space of the place; counted once."""
    return describe_unproven(place.field)


@lru_cache(maxsize=1)
def build_searcher(place: Place, camera: Camera, noise: ColorNoise) -> GlobalLocalizer:
    """Make the global localizer of the place; once, for it renders panoramas everywhere first."""
    return GlobalLocalizer(place.field, camera, noise, RelocaliseConfig().for_field(place.field.info))
