import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
import torch

import nerfnav_scenes as scenes
from nerfnav import robots
from nerfnav.field.models.voxel import VoxelField
from nerfnav.planner.space.astar import SearchConfig, find_paths
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.robots.state import RigidState
from nerfnav.world.collision import ground
from nerfnav.world.contact import ContactConfig, contact_check
from nerfnav.world.raycast import RayCaster
from nerfnav.world.scene import Scene
from nerfnav.world.task import Task
from tests.scenes.rasters import raster_field

_ACROSS = math.pi / 2
_DOORS = {  # the middle of each doorway, and the direction through it
    "living room to kitchen": ((-2.95, 0.35), _ACROSS),
    "living room to hall": ((-0.075, 0.35), _ACROSS),
    "hall to bedroom": ((2.1, 0.35), _ACROSS),
    "kitchen to hall": ((-1.3, 0.925), 0.0),
    "hall to study": ((3.325, 1.5), _ACROSS),
}


@pytest.fixture(scope="module")
def apartment() -> Scene:
    return scenes.load("apartment")


@pytest.fixture(scope="module")
def truth(apartment: Scene) -> VoxelField:
    return raster_field(apartment, 0.04)


@pytest.fixture(scope="module")
def sight(apartment: Scene) -> RayCaster:
    return RayCaster(apartment.mesh)


MapOf = Callable[[str, float | None], OccupancyMap]


@pytest.fixture(scope="module")
def map_of(truth: VoxelField) -> MapOf:
    """Where a robot fits, with 1 cm around its body, at one height if it stays on the ground; made once for each."""
    config = OccupancyConfig(headings=16)
    return cache(lambda robot, height: OccupancyMap.of(truth, robots.load(robot).body_with_room(0.01), config, height))


def _seen(sight: RayCaster, eye: tuple[float, float, float], ray: tuple[float, float, float]) -> float:
    """How far one sees [m]."""
    origins, rays = np.array([eye], np.float32), np.array([ray], np.float32)
    return float(sight.first_hits(origins, rays).distance[0])


def test_it_is_as_large_as_an_apartment(apartment: Scene, sight: RayCaster):
    """Between opposite walls, and from the floor to the ceiling, measured where nothing stands in the way."""
    assert _seen(sight, (0, -0.2, 2.45), (-1, 0, 0)) == pytest.approx(4.5, abs=0.02)
    assert _seen(sight, (3, 0.9, 2.45), (1, 0, 0)) == pytest.approx(1.5, abs=0.02)
    assert _seen(sight, (-2.0, -0.2, 1.0), (0, 0, 1)) == pytest.approx(1.6, abs=0.01)
    assert apartment.box.size.tolist() == pytest.approx([9.4, 7.4, 2.84], abs=0.01)


@pytest.mark.parametrize("name", _DOORS)
def test_doors_are_80_to_90_cm_wide_and_open(sight: RayCaster, name: str):
    (x, y), heading = _DOORS[name]
    side = (-math.sin(heading), math.cos(heading), 0.0)
    back = (-side[0], -side[1], 0.0)
    for height in (0.3, 1.0, 1.9):
        assert 0.79 <= _seen(sight, (x, y, height), side) + _seen(sight, (x, y, height), back) <= 0.9
        for way in (0.0, math.pi):
            ahead = (math.cos(heading + way), math.sin(heading + way), 0.0)
            assert _seen(sight, (x, y, height), ahead) > 0.5


def _pushed(scene: Scene, robot: str, start: tuple[float, ...], goal: tuple[float, ...], yaw: float) -> bool:
    """Whether a robot touches anything on a straight way without turning."""
    touches = contact_check(scene, robots.load(robot).body, ContactConfig(spacing=0.02))
    return touches(RigidState.at_rest(start, yaw), RigidState.at_rest(goal, yaw))


def test_a_sofa_fits_through_a_door_only_lengthwise(apartment: Scene):
    ends = (-2.95, -0.8, 0.3), (-2.95, 1.4, 0.3)
    assert not _pushed(apartment, "sofa", *ends, _ACROSS)
    assert _pushed(apartment, "sofa", *ends, 0.0)


def test_the_first_move_of_a_sofa_begins_and_ends_across_the_door(apartment: Scene):
    task = next(task for task in apartment.tasks if task.robot == "sofa")
    assert task.start_yaw == task.goal_yaw == 0.0
    assert contact_check(apartment, robots.load("sofa").body)(task.start_state, task.goal_state)


def test_a_quadrotor_of_25_cm_fits_through_the_hatch_and_the_windows_have_no_glass(apartment: Scene, sight: RayCaster):
    assert not _pushed(apartment, "quadrotor25", (-1.85, -0.6, 1.4), (-1.85, 1.3, 1.4), 0.0)
    assert math.isinf(_seen(sight, (-2.5, -1.0, 1.5), (0, -1, 0)))
    assert math.isinf(_seen(sight, (1.0, 2.0, 1.9), (0, 1, 0)))


def test_walls_are_plain(apartment: Scene, sight: RayCaster):
    """Within 20 cm, colours of paint change by less than what a camera's noise hides; those of a rug do not."""
    colors = apartment.mesh.visual.vertex_colors[:, :3].astype(float)

    def patch(eye: tuple[float, float, float], ray: tuple[float, float, float], across: np.ndarray) -> np.ndarray:
        spread = np.random.default_rng(0).uniform(-0.1, 0.1, (200, 2)) @ across
        origins = (np.array(eye) + spread).astype(np.float32)
        face = sight.first_hits(origins, np.tile(np.array(ray, np.float32), (200, 1))).face
        return colors[apartment.mesh.faces[face]].mean(1)

    upright = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    for y, z in [(-0.1, 2.3), (-2.9, 1.2), (1.9, 0.4)]:
        assert patch((-4.0, y, z), (-1, 0, 0), upright).std(0).max() < 4
    flat = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    assert patch((-1.3, -1.2, 0.5), (0, 0, -1), flat).std(0).max() > 15


def test_some_things_are_thinner_than_a_voxel(apartment: Scene):
    assert apartment.voxel is not None
    thinnest = [np.sort(solid.extents)[1] for solid in apartment.solids]
    assert sum(width < apartment.voxel for width in thinnest) > 30
    assert min(thinnest) < 0.5 * apartment.voxel, "wires"


def test_there_are_tasks_for_robots_of_the_size_of_rooms(apartment: Scene):
    count = {robot: sum(task.robot == robot for task in apartment.tasks) for robot in ("quadrotor25", "sofa", "cart")}
    assert count == {"quadrotor25": 10, "sofa": 3, "cart": 5}
    assert apartment.tasks[0].robot == "quadrotor25"


def test_robots_on_the_ground_stand_10_cm_above_the_floor(apartment: Scene):
    for task in apartment.tasks:
        robot = robots.load(task.robot)
        if robot.planar:
            assert task.start[2] == task.goal[2] == pytest.approx(0.1 + robot.body.extents[2] / 2)


def test_walls_stand_in_the_way_of_most_flights(apartment: Scene):
    touches = contact_check(apartment, robots.load("quadrotor25").body)
    flights = [task for task in apartment.tasks if task.robot == "quadrotor25"]
    assert sum(touches(task.start_state, task.goal_state) for task in flights) >= 5


@pytest.mark.slow
@pytest.mark.parametrize(
    "task",
    [
        pytest.param(task, id=f"{task.robot}: {task.name}", marks=[pytest.mark.slow] * (task.robot == "quadrotor25"))
        for task in scenes.tasks_of("apartment")  # the map of one height is made in a moment, that of the air is not
    ],
)
def test_a_clear_way_joins_the_ends_of_each_task_in_the_true_mesh(apartment: Scene, map_of: MapOf, task: Task):
    """A* over the rasterised solids for the robot's body with 1 cm around it, judged on the mesh itself."""
    robot = robots.load(task.robot)
    occupancy = map_of(task.robot, task.start[2] if robot.planar else None)
    paths = find_paths(occupancy, task.start_state, task.goal_state, SearchConfig.single())
    assert paths, "no way"
    rows = paths[0].tolist()
    yaws = [row[3] for row in rows] if len(rows[0]) == 4 else [task.start_yaw] * len(rows)
    states = [RigidState.at_rest((x, y, z), yaw) for (x, y, z, *_), yaw in zip(rows, yaws, strict=True)]
    if task.robot == "cart":  # its map is that of any heading: of a body as wide as it is long
        robot = robot.with_body(robot.body.box((0.4, 0.4, 0.35), (2, 2, 2)))
    touched = ground(apartment).touches(robot.body, RigidState.stack(states))
    assert not touched.any(), torch.stack([state.position for state in states])[touched]
