"""Obstacles in fields and in ground truths: where they stand, and nowhere else."""

import numpy as np
import pytest
import torch
import trimesh
from trimesh.visual.texture import TextureVisuals

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import BallsField, Occupancy, UnknownSpace, VoxelField, density_and_gradient, planning_field
from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.field.models.bricks import convert_to_bricks
from nerfnav.geometry import Box, Camera, look_at
from nerfnav.obstacles import BoxShape, Obstacle, ObstacleSet, Sphere, place_in_field, place_in_scene
from nerfnav.world import MeshRenderer, Scene
from nerfnav.world.collision import ground

BOX = Box.of((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0))
VOXEL = 0.05
CRATE = Obstacle("crate", BoxShape((0.3, 0.4, 0.5)), (0.3, -0.2, 0.4), (0.0, 0.0, 0.6), color=(1.0, 0.0, 0.0))
PLATE = Obstacle("plate", BoxShape((0.004, 0.8, 0.6)), (-0.513, 0.0, 0.4), color=(0.0, 0.0, 1.0))


def empty(states: Occupancy | None) -> VoxelField:
    values = torch.full((41, 41, 21, 4), 0.5)
    values[..., 0] = EMPTY_RAW
    evidence = None if states is None else torch.full((41, 41, 21), int(states), dtype=torch.uint8)
    return VoxelField(BOX, values, torch.ones(3), evidence=evidence)


@pytest.mark.parametrize("states", [None, Occupancy.FREE, Occupancy.UNPROVEN])
def test_a_field_is_solid_in_an_obstacle_and_as_it_was_elsewhere(states: Occupancy | None) -> None:
    field, obstacles = empty(states), ObstacleSet((CRATE, PLATE))
    placed = place_in_field(field, obstacles)
    points = np.random.default_rng(0).uniform((-1, -1, 0), (1, 1, 1), (5000, 3))
    distance = obstacles.signed_distance(points)
    for unknown in UnknownSpace:
        density, _ = density_and_gradient(planning_field(placed, unknown), points)
        before, _ = density_and_gradient(planning_field(field, unknown), points)
        assert density[distance < 0].min() > 20
        np.testing.assert_array_equal(density[distance > 4 * VOXEL], before[distance > 4 * VOXEL])
    assert torch.equal(field.values, empty(states).values)
    inside = torch.from_numpy(points[CRATE.signed_distance(points) < 0])
    assert (placed.radiance(inside, inside) - torch.tensor([1.0, 0.0, 0.0])).abs().max() < 1e-6
    if states is Occupancy.FREE:
        assert placed.evidence is not None and set(placed.evidence.unique().tolist()) == {0, 1}


def test_bricks_hold_the_same_obstacles_as_voxels() -> None:
    field, obstacles = empty(Occupancy.FREE), ObstacleSet((CRATE, PLATE))
    dense, sparse = place_in_field(field, obstacles), place_in_field(convert_to_bricks(field), obstacles)
    points = torch.from_numpy(np.random.default_rng(1).uniform((-1, -1, 0), (1, 1, 1), (5000, 3)))
    torch.testing.assert_close(sparse.density(points), dense.density(points))
    torch.testing.assert_close(sparse.radiance(points, points), dense.radiance(points, points))
    planned = [planning_field(each, UnknownSpace.OCCUPIED).density(points) for each in (sparse, dense)]
    torch.testing.assert_close(*planned)


def test_fields_without_a_grid_and_obstacles_outside_are_refused() -> None:
    balls = BallsField(BOX, torch.zeros(1, 3), torch.ones(1))
    with pytest.raises(InvalidInputError, match="bake this one first"):
        place_in_field(balls, ObstacleSet((CRATE,)))
    away = Obstacle("away", Sphere(0.3), (5.0, 0.0, 0.5))
    with pytest.raises(InvalidInputError, match=r"the obstacle .away. at x 5.00, y 0.00, z 0.50 m lies outside"):
        place_in_field(empty(None), ObstacleSet((away,)))


def scene_of(mesh: trimesh.Trimesh) -> Scene:
    return Scene("floor", "Floor", mesh, (mesh,), BOX, (0.2, 0.4, 0.6), ())


def colored(kind: str) -> trimesh.Trimesh:
    mesh = trimesh.creation.box((2.0, 2.0, 0.2)).apply_translation((0.0, 0.0, -0.1))
    random = np.random.default_rng(0)
    if kind == "vertex":
        mesh.visual.vertex_colors = random.integers(0, 255, (len(mesh.vertices), 4))
    elif kind == "face":
        mesh.visual.face_colors = random.integers(0, 255, (len(mesh.faces), 4))
    elif kind == "texture":
        from PIL import Image

        image = Image.fromarray(random.integers(0, 255, (8, 8, 3)).astype(np.uint8))
        material = trimesh.visual.material.SimpleMaterial(image=image)
        mesh.visual = TextureVisuals(random.random((len(mesh.vertices), 2)), material)
    return mesh


@pytest.mark.parametrize("kind", ["vertex", "face", "texture", "none"])
def test_a_scene_shows_an_obstacle_and_looks_as_before_beside_it(kind: str) -> None:
    scene = scene_of(colored(kind))
    placed = place_in_scene(scene, ObstacleSet((CRATE,)))
    camera, pose = Camera.from_fov(60, 60, 80), look_at(torch.tensor([-0.9, -0.9, 0.9]), torch.tensor([0.2, -0.1, 0.1]))
    before, after = (MeshRenderer(each).render(camera, pose) for each in (scene, placed))
    red = (after.image == torch.tensor([255, 0, 0], dtype=torch.uint8)).all(-1)
    assert 100 < red.sum() < 3000
    assert (before.image[~red].int() - after.image[~red].int()).abs().max() <= 1
    assert (after.depth[red] < before.depth[red]).all() and torch.equal(after.depth[~red], before.depth[~red])


def test_a_body_touches_an_obstacle_of_the_ground_truth() -> None:
    from nerfnav.robots import Body, RigidState

    scene = scene_of(colored("none"))
    placed = place_in_scene(scene, ObstacleSet((CRATE,)))
    body = Body.box((0.1, 0.1, 0.1), (2, 2, 2))
    for place, touched in (((0.3, -0.2, 0.4), True), ((0.3, -0.2, 0.8), False)):
        state = RigidState.at_rest(place, 0.0)
        states = RigidState.stack([state])
        assert ground(placed).touches(body, states).tolist() == [touched]
        assert ground(scene).touches(body, states).tolist() == [False]
