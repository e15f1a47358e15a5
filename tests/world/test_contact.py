import math

import numpy as np
import pytest
import torch
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav.robots.body import Body
from nerfnav.robots.state import RigidState, interpolate_poses
from nerfnav.world.collision import Ground
from nerfnav.world.contact import ContactConfig, contact_check, judge, level_contact_check
from nerfnav.world.scene import Scene
from nerfnav.world.solid import winding_number
from nerfnav.world.triangle_index import boxes_touch_triangles

_BODY = Body.box((0.1, 0.1, 0.04), (2, 2, 2))
SPACING = (ContactConfig.spacing, ContactConfig.rotation_spacing)


def _scene(*solids: trimesh.Trimesh) -> Scene:
    mesh = trimesh.util.concatenate(list(solids))
    return Scene("test", "Test", mesh, solids, Box.of((-1, -1, -1), (1, 1, 1)), (1.0, 1.0, 1.0), ())


def _cube(edge: float, center: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    return trimesh.creation.box((edge, edge, edge), trimesh.transformations.translation_matrix(center))


def _states(*positions: tuple[float, float, float]) -> RigidState:
    return RigidState.stack([RigidState.at_rest(position) for position in positions])


def _random_poses(count: int, spread: float) -> RigidState:
    generator = torch.Generator().manual_seed(0)
    still = torch.zeros(count, 3)
    rotation = so3.exp(2 * torch.randn(count, 3, generator=generator))
    return RigidState(spread * torch.randn(count, 3, generator=generator), still, rotation, still)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.12, 0.0, 0.0), (0.13, -0.11, 0.1), (0.2, 0.0, 0.0)])
def test_the_overlap_of_aligned_boxes_is_the_product_of_their_shared_edges(offset: tuple[float, float, float]):
    edges = zip(_BODY.extents, offset, strict=True)
    shared = [max(0.0, min(0.1, at + e / 2) - max(-0.1, at - e / 2)) for e, at in edges]
    overlap = Ground(_scene(_cube(0.2))).overlaps(_BODY, _states(offset))
    assert overlap.item() == pytest.approx(math.prod(shared), abs=1e-9)


def test_the_overlap_of_a_turned_body_is_exact():
    """A square of edge a turned by 45 degrees, its middle on a wall's face: half of it is inside."""
    state = RigidState.at_rest((0.1, 0.0, 0.0), yaw=math.pi / 4)
    overlap = Ground(_scene(_cube(0.2))).overlaps(_BODY, RigidState.stack([state]))
    assert overlap.item() == pytest.approx(0.5 * 0.1 * 0.1 * 0.04, rel=1e-6)


def test_solids_that_overlap_one_another_are_counted_once():
    twice = Ground(_scene(_cube(0.2), _cube(0.2, (0.05, 0.0, 0.0)))).overlaps(_BODY, _states((0.0, 0.0, 0.0)))
    assert twice.item() == pytest.approx(math.prod(_BODY.extents), rel=1e-6)


def test_a_body_wholly_inside_a_solid_touches_it():
    deep = Ground(_scene(_cube(1.0)))
    assert deep.touches(_BODY, _states((0.1, 0.0, 0.2), (0.7, 0.0, 0.0))).tolist() == [True, False]


def test_touching_agrees_with_the_exact_overlap_in_any_attitude():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.12)
    poses = _random_poses(400, spread=0.15)
    ground = Ground(_scene(ball, _cube(0.1, (0.2, 0.1, 0.0))))
    touched, overlap = ground.touches(_BODY, poses), ground.overlaps(_BODY, poses)
    assert 50 < touched.sum() < 350
    assert torch.equal(touched, overlap > 0)


def test_poses_along_a_way_touch_what_each_alone_touches():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.12)
    ground = Ground(_scene(ball, _cube(0.1, (0.3, 0.1, 0.0)), _cube(2.0, (0.0, 0.0, -1.1))))
    ends = _states((-0.5, -0.1, 0.13), (0.5, 0.1, 0.05), (0.5, 0.3, -0.05), (-0.4, 0.0, 0.1))
    poses, _ = interpolate_poses(ends, *SPACING)
    together = ground.touches(_BODY, poses)
    alone = torch.cat([ground.touches(_BODY, poses[k : k + 1]) for k in range(len(together))])
    assert 100 < together.sum() < len(together) - 100
    assert torch.equal(together, alone)


def test_a_triangle_that_only_passes_by_a_corner_does_not_touch():
    half = np.array([1.0, 1.0, 1.0])
    near = np.array([[2.9, 0, 0], [0, 2.9, 0], [0, 0, 2.9]])
    assert boxes_touch_triangles(np.stack([near, 3.1 / 2.9 * near]), half).tolist() == [True, False]


def test_an_open_mesh_is_judged_by_its_winding_number():
    open_cube = _cube(0.2)
    open_cube.update_faces(np.arange(12) != 3)
    assert not open_cube.is_watertight
    ground = Ground(_scene(open_cube))
    inside, half_out = ground.overlaps(_BODY, _states((0.0, 0.0, 0.0), (0.1, 0.0, 0.0)))
    assert inside.item() == pytest.approx(4e-4, rel=0.05)
    assert half_out.item() == pytest.approx(2e-4, rel=0.25)
    assert ground.touches(_BODY, _states((0.0, 0.0, 0.0))).item()


def test_open_and_watertight_solids_are_not_counted_twice_where_they_overlap():
    open_cube = _cube(0.2)
    open_cube.update_faces(np.arange(12) != 3)
    overlap = Ground(_scene(open_cube, _cube(0.2))).overlaps(_BODY, _states((0.0, 0.0, 0.0)))
    assert overlap.item() == pytest.approx(4e-4, rel=1e-6)


def test_the_winding_number_is_one_inside_and_zero_outside():
    ball = trimesh.creation.icosphere(subdivisions=2)
    numbers = winding_number(ball.triangles, np.array([[0.1, 0.2, 0.3], [2.0, 0.0, 0.0]]))
    assert np.allclose(numbers, [1, 0], atol=1e-9)


def test_interpolated_poses_are_dense_in_place_and_attitude_and_keep_the_given_states():
    states = RigidState.stack(
        [
            RigidState.at_rest((0.0, 0.0, 0.0)),
            RigidState.at_rest((0.1, 0.0, 0.0), yaw=0.01),
            RigidState.at_rest((0.1, 0.0, 0.0), yaw=1.0),
        ]
    )
    poses, _ = interpolate_poses(states, *SPACING)
    assert len(poses.position) == 20 + 50 + 1
    assert poses.position.diff(dim=0).norm(dim=-1).max() < 0.005 + 1e-6
    assert so3.local(poses[:-1].rotation, poses[1:].rotation).norm(dim=-1).max() < 0.02 + 1e-5
    for index, state in [(0, 0), (20, 1), (70, 2)]:
        assert torch.allclose(poses.position[index], states.position[state], atol=1e-6)
        assert torch.allclose(poses.rotation[index], states.rotation[state], atol=1e-5)


def test_a_wall_between_two_states_is_not_tunnelled_through():
    wall = trimesh.creation.box((0.01, 1.0, 1.0))
    scene = _scene(wall)
    states = _states((-0.6, 0, 0), (-0.3, 0, 0), (0.3, 0, 0), (0.6, 0, 0))
    assert not Ground(scene).touches(_BODY, states).any()
    report = judge(scene, _BODY, states)
    assert report.touched.tolist() == [False, True, False]
    assert report.first_touched_step == 1
    assert report.max_overlap_m3 == pytest.approx(0.01 * 0.1 * 0.04, rel=1e-6)
    assert torch.equal(report.overlap_m3 > 0, report.touched_poses)
    check = contact_check(scene, _BODY)
    assert [check(states[k], states[k + 1]) for k in range(3)] == [False, True, False]


def test_a_clean_flight_touches_nothing():
    report = judge(_scene(_cube(0.2)), _BODY, _states((-0.5, 0.3, 0), (0.5, 0.3, 0)))
    assert report.max_overlap_m3 == 0
    assert report.first_touched_step is None


def test_a_state_that_touches_belongs_to_the_steps_before_and_after_it():
    states = _states((-0.5, 0.3, 0), (0.0, 0.149, 0.0), (0.5, 0.3, 0))
    assert judge(_scene(_cube(0.2)), _BODY, states).touched.tolist() == [True, True]


def test_a_body_of_its_own_shape_is_judged_by_that_shape_and_not_by_the_box_around_it():
    """A ball in the corner between two walls: the box around it would be cut, the ball is not."""
    ball = Body.from_mesh(trimesh.creation.icosphere(subdivisions=3, radius=0.1), spacing=0.05)
    ground = Ground(_scene(_cube(1.0)))
    near_edge, into_face = _states((0.58, 0.58, 0.0), (0.55, 0.0, 0.0))
    states = RigidState.stack([near_edge, into_face])
    box = Body.box((0.2, 0.2, 0.2), (2, 2, 2))
    assert ground.touches(box, states).tolist() == [True, True]
    assert ground.touches(ball, states).tolist() == [False, True]
    cap = math.pi * 0.05**2 * (3 * 0.1 - 0.05) / 3
    assert ground.overlaps(ball, states).tolist() == pytest.approx([0.0, cap], rel=0.05)


def test_a_solid_body_wholly_inside_a_solid_touches_it():
    ball = Body.from_mesh(trimesh.creation.icosphere(radius=0.1), spacing=0.05)
    ground = Ground(_scene(_cube(1.0)))
    assert ground.touches(ball, _states((0.1, 0.0, 0.2), (0.7, 0.0, 0.0))).tolist() == [True, False]
    assert ground.overlaps(ball, _states((0.0, 0.0, 0.0))).item() == pytest.approx(4e-3 * math.pi / 3, rel=0.1)


def test_a_cross_of_thin_arms_is_judged_by_its_arms():
    arms = [trimesh.creation.box(edges) for edges in ((0.5, 0.01, 0.01), (0.01, 0.5, 0.01))]
    cross = Body.from_mesh(trimesh.boolean.union(arms), spacing=0.05)
    beside, beneath = _states((0.3, 0.3, 0.0), (0.3, 0.0, 0.0))
    states = RigidState.stack([beside, beneath])
    assert Ground(_scene(_cube(0.2))).touches(cross, states).tolist() == [False, True]
    assert Ground(_wall_without_thickness()).touches(cross, states).tolist() == [False, False]
    assert Ground(_wall_without_thickness()).touches(cross, _states((0.2, 0.5, 0.0))).tolist() == [True]


def _wall_without_thickness() -> Scene:
    wall = trimesh.Trimesh([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]], [[0, 1, 2], [0, 2, 3]], process=False)
    return Scene("wall", "Wall", wall, (), Box.of((-1, -1, -1), (1, 1, 1)), (1.0, 1.0, 1.0), (), sheets=(wall,))


def test_a_wall_without_thickness_is_touched_and_counts_the_cells_that_it_cuts():
    ground = Ground(_wall_without_thickness())
    states = _states((0.004, 0.0, 0.0), (0.06, 0.0, 0.0), (-0.3, 0.0, 0.0))
    assert ground.touches(_BODY, states).tolist() == [True, False, False]
    assert ground.overlaps(_BODY, states).tolist() == pytest.approx([math.prod(_BODY.extents) / 8, 0, 0])


def test_a_solid_body_meets_a_wall_without_thickness_with_its_shape_alone():
    ball = Body.from_mesh(trimesh.creation.icosphere(subdivisions=3, radius=0.1), spacing=0.05)
    turned = RigidState.at_rest((0.12, 0.0, 0.0), yaw=math.pi / 4)  # the box around it reaches the wall with an edge
    states = RigidState.stack([turned, RigidState.at_rest((0.05, 0.0, 0.0))])
    ground = Ground(_wall_without_thickness())
    assert ground.touches(Body.box((0.2, 0.2, 0.2), (2, 2, 2)), states).tolist() == [True, True]
    assert ground.touches(ball, states).tolist() == [False, True]


def test_what_a_solid_holds_is_not_counted_again_for_a_sheet_in_it():
    sheet = _wall_without_thickness().mesh
    cube = _cube(1.0)
    scene = Scene("both", "Both", cube, (cube,), Box.of((-1, -1, -1), (1, 1, 1)), (1.0,) * 3, (), sheets=(sheet,))
    assert Ground(scene).overlaps(_BODY, _states((0.004, 0.0, 0.0))).item() == pytest.approx(4e-4, rel=1e-6)


def test_a_place_without_anything_is_never_touched():
    empty = Scene("air", "Air", trimesh.Trimesh(), (), Box.of((-1, -1, -1), (1, 1, 1)), (1.0, 1.0, 1.0), ())
    assert not Ground(empty).touches(_BODY, _states((0.0, 0.0, 0.0))).any()


def test_states_that_are_no_numbers_are_refused_in_one_sentence():
    states = _states((0.0, 0.0, 3.0), (0.0, float("nan"), 3.0))
    with pytest.raises(InvalidInputError, match="1 of 2 are not: the first is state 1"):
        judge(_scene(_cube(0.2)), _BODY, states)


@pytest.mark.parametrize("away", [3.0, 1e6, 1e18, math.inf, math.nan])
def test_a_robot_that_has_gone_far_away_is_judged_at_once(away: float) -> None:
    touched, here = contact_check(_scene(_cube(0.2)), _BODY), RigidState.at_rest((0.5, 0.0, 0.0))
    there = RigidState.at_rest((away, 0.0, 0.0), yaw=1.0)
    assert not touched(here, there) and not touched(there, there)
    assert touched(RigidState.at_rest((-away, 0.0, 0.0)), there) is math.isfinite(away), "through the cube"


def test_the_part_of_a_path_near_the_ground_truth_touches_what_all_of_it_touches() -> None:
    scene = _scene(_cube(0.1), _cube(0.2, (0.6, 0.3, 0.1)))
    touched, ends = contact_check(scene, _BODY), _random_poses(120, spread=1.0)
    found = []
    for before, after in zip(ends[:60], ends[60:], strict=True):
        poses, _ = interpolate_poses(RigidState.stack([before, after]), *SPACING)
        found.append(bool(Ground(scene).touches(_BODY, poses).any()))
        assert touched(before, after) is found[-1]
    assert 2 < sum(found) < 57


def test_a_landing_is_on_level_surfaces_alone() -> None:
    def ramp(angle: float) -> Scene:
        floor = trimesh.creation.box((4.0, 4.0, 0.2), trimesh.transformations.translation_matrix((0, 0, -0.1)))
        return _scene(floor.apply_transform(trimesh.transformations.rotation_matrix(angle, (0, 1, 0))))

    above, below = RigidState.at_rest((0.0, 0.0, 0.1)), RigidState.at_rest((0.0, 0.0, -0.02))
    for angle, level in ((0.0, True), (0.3, True), (0.4, False)):
        assert level_contact_check(ramp(angle), _BODY, math.radians(20))(above, below) is level
    assert not level_contact_check(ramp(0.0), _BODY, math.radians(20))(above, above), "it touches nothing"
    wall = _scene(_cube(0.2))
    aside = RigidState.at_rest((0.2, 0.0, 0.0))
    assert not level_contact_check(wall, _BODY, math.radians(20))(aside, RigidState.at_rest((0.14, 0.0, 0.0)))
