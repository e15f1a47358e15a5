import numpy as np
import pytest
import torch
from scipy.ndimage import binary_dilation, label

import nerfnav_scenes as scenes
from nerfnav.geometry.camera import Camera, Pose, look_at
from nerfnav.robots.body import Body
from nerfnav.world.contact import contact_check
from nerfnav.world.raycast import MeshRenderer
from nerfnav.world.scene import Scene
from nerfnav.world.solid import Solid

_BODY = Body.box((0.1, 0.1, 0.04), (2, 2, 2))
_CELL = 0.02


@pytest.fixture(scope="module")
def stonehenge() -> Scene:
    return scenes.load("stonehenge")


def test_the_tasks_are_the_authors_ten_and_their_headline(stonehenge: Scene):
    assert [task.robot for task in stonehenge.tasks] == ["quadrotor"] * 11 + ["diffdrive"] * 5
    assert (stonehenge.tasks[0].start, stonehenge.tasks[0].goal) == ((0.55, -0.02, 0.1), (-0.72, 0.17, 0.19))
    assert (stonehenge.tasks[9].start, stonehenge.tasks[9].goal) == ((-0.72, -0.42, 0.1), (0.49, 0.23, 0.16))
    assert (stonehenge.tasks[10].start, stonehenge.tasks[10].goal) == ((0.39, -0.67, 0.2), (-0.4, 0.55, 0.16))


def test_stones_stand_in_the_way_of_most_straight_flights(stonehenge: Scene):
    touches = contact_check(stonehenge, _BODY)
    blocked = [touches(task.start_state, task.goal_state) for task in stonehenge.tasks]
    assert sum(blocked[:10]) >= 6
    assert blocked[10]


def _cells(points: np.ndarray, lower: np.ndarray) -> tuple[np.ndarray, ...]:
    return tuple(np.round((points - lower) / _CELL).astype(int).T)


@pytest.mark.slow
def test_a_body_can_fly_from_every_start_to_its_goal_with_5_cm_to_spare(stonehenge: Scene):
    """Free cells, grown stones taken out, hang together; the ground, which starts are close to, is grown by 2 cm."""
    lower, upper = stonehenge.box.lower.double().numpy(), stonehenge.box.upper.double().numpy()
    lower[2] = -0.03
    axes = [np.arange(a, b, _CELL) for a, b in zip(lower, upper, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    shape = points.shape[:3]
    filled = [Solid(mesh).contains(points.reshape(-1, 3)).reshape(shape) for mesh in stonehenge.solids]
    # half a body, the margin, and a cell for what lies between the cells' middles
    across, stones_up, ground_up = (int(np.ceil(m / _CELL)) + 1 for m in (0.05 + 0.05, 0.02 + 0.05, 0.02 + 0.0))
    stones = binary_dilation(np.any(filled[1:], 0), np.ones((2 * across + 1, 2 * across + 1, 2 * stones_up + 1)))
    earth = binary_dilation(filled[0], np.ones((2 * across + 1, 2 * across + 1, 2 * ground_up + 1)))
    regions, _ = label(~(stones | earth))
    flights = stonehenge.tasks[:11]
    starts = _cells(np.array([task.start for task in flights]), lower)
    goals = _cells(np.array([task.goal for task in flights]), lower)
    assert (regions[starts] > 0).all()
    assert (regions[starts] == regions[goals]).all()


def test_stones_are_thick_enough_for_voxels(stonehenge: Scene):
    for stone in stonehenge.solids[1:]:
        assert stone.bounding_box_oriented.primitive.extents.min() > 0.05


def test_every_view_says_where_it_was_taken_from(stonehenge: Scene):
    """Moving by 3 cm or turning by 2 degrees changes a robot's picture much more than a field's usual error."""
    renderer = MeshRenderer(stonehenge)
    camera = Camera.from_fov(100, 100, 90.0)

    def view(position: torch.Tensor, turn: float) -> torch.Tensor:
        angle = torch.tensor(turn)
        ahead = torch.stack([angle.cos(), angle.sin(), torch.tensor(-0.1)])
        pose: Pose = look_at(position, position + ahead)
        return renderer.render(camera, pose).image.float() / 255

    for task in stonehenge.tasks[:11]:
        start = torch.tensor(task.start)
        way = torch.tensor(task.goal) - start
        heading = float(torch.atan2(way[1], way[0]))
        here = view(start, heading)
        for changed in [view(start, heading + 0.035), view(start + torch.tensor([0.0, 0.0, 0.03]), heading)]:
            assert (here - changed).square().mean().sqrt() > 0.04
