"""Cut-outs: what is cut out and pasted back is as before, and what a part leaves behind is unproven."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import Occupancy, UnknownSpace, density_at, planning_field
from nerfnav.field.models.bricks import convert_to_bricks
from nerfnav.field.models.voxel import EMPTY_RAW, VoxelField
from nerfnav.geometry import Box
from nerfnav.obstacles import (
    BoxShape,
    CutOut,
    Obstacle,
    ObstacleSet,
    Sphere,
    place_in_field,
    place_in_scene,
    read_obstacles,
    replace_in_field,
    require_placeable,
)
from nerfnav.world import Scene

STONE = np.array([0.5, 0.5, 0.3])
CUT = CutOut(BoxShape((0.4, 0.4, 0.6)), (0.5, 0.5, 0.3))


def stone_field() -> VoxelField:
    """A stone of 20 x 20 x 40 cm on a floor, in proven air; nothing is known of its inside."""
    values = torch.full((41, 41, 21, 4), EMPTY_RAW)
    states = torch.full((41, 41, 21), int(Occupancy.FREE), dtype=torch.uint8)
    x, y, z = torch.meshgrid(*(torch.arange(count) * 0.05 for count in states.shape), indexing="ij")
    gap = torch.stack([(x - 0.5).abs() - 0.1, (y - 0.5).abs() - 0.1, (z - 0.25).abs() - 0.2]).amax(0)
    values[..., 0] = (-60 * gap).clamp(EMPTY_RAW, 2)
    values[..., 1:] = torch.stack([x, y, z], -1) / 2
    states[gap < 0.01] = int(Occupancy.SOLID)
    states[gap < -0.07] = int(Occupancy.UNPROVEN)
    return VoxelField(Box.of((0, 0, 0), (2, 2, 1)), values, torch.ones(3), evidence=states)


def placed_at(position: tuple[float, float, float], yaw: float = 0.0) -> ObstacleSet:
    return ObstacleSet((Obstacle("stone", CUT, position, (0.0, 0.0, yaw)),))


@pytest.mark.parametrize("unknown", list(UnknownSpace))
def test_a_part_that_is_pasted_where_it_was_gives_the_map_of_before(unknown: UnknownSpace) -> None:
    field = stone_field()
    pasted = place_in_field(field, placed_at(CUT.position))
    points = np.random.default_rng(0).uniform((0, 0, 0), (2, 2, 1), (4000, 3))
    before, after = (density_at(planning_field(each, unknown), points) for each in (field, pasted))
    np.testing.assert_allclose(after, before, rtol=1e-3, atol=1e-3)


def test_a_moved_part_leaves_unproven_space_behind_and_is_where_it_went() -> None:
    field = stone_field()
    moved = place_in_field(field, placed_at((1.3, 1.2, 0.3), yaw=np.pi / 2))
    middle, there = STONE[None] * (1, 1, 2 / 3), np.array([[1.3, 1.2, 0.2]])
    closed, open_ = (planning_field(moved, unknown) for unknown in (UnknownSpace.OCCUPIED, UnknownSpace.FREE))
    assert density_at(closed, middle)[0] > closed.solid_density, "a plan may lead through what nobody saw"
    assert density_at(open_, middle)[0] < 0.1
    assert density_at(open_, there + np.array([0.08, 0.08, 0]))[0] > open_.solid_density
    beside = np.array([[0.67, 0.5, 0.3]])
    assert density_at(closed, beside)[0] < 0.1, "air in the volume was proven free"
    assert moved.evidence is not None and moved.values.shape == field.values.shape
    np.testing.assert_allclose(moved.between_nodes(torch.tensor([[1.3, 1.2, 0.2]]), slice(1, 4))[0, 2], 0.1, atol=0.03)


def test_a_field_whose_space_was_never_proven_has_unproven_space_where_a_part_was() -> None:
    field = replace(stone_field(), evidence=None)
    moved = place_in_field(field, placed_at((1.3, 1.2, 0.3)))
    closed = planning_field(moved, UnknownSpace.OCCUPIED)
    assert density_at(closed, np.array([[0.5, 0.5, 0.2]]))[0] > closed.solid_density
    elsewhere = np.random.default_rng(1).uniform((0, 1.6, 0), (2, 2, 1), (500, 3))
    np.testing.assert_allclose(density_at(closed, elsewhere), density_at(field, elsewhere), atol=1e-6)


def test_one_step_after_the_other_gives_what_all_at_once_gives() -> None:
    field, other = stone_field(), Obstacle("ball", Sphere(0.15), (0.6, 0.5, 0.3))
    sets = [
        placed_at((0.5, 0.5, 0.3)),
        ObstacleSet((other, *placed_at((0.8, 0.5, 0.3)).obstacles)),
        ObstacleSet((other, *placed_at((1.3, 1.2, 0.3), 0.4).obstacles)),
        ObstacleSet((other,)),
    ]
    last, before = field, ObstacleSet(())
    for now in sets:
        last, before = replace_in_field(field, now, last, before), now
        whole = place_in_field(field, now)
        torch.testing.assert_close(last.values[..., 0], whole.values[..., 0])
        assert last.evidence is not None and whole.evidence is not None and torch.equal(last.evidence, whole.evidence)


def test_bricks_are_cut_as_dense_grids_are() -> None:
    field = stone_field()
    moved = placed_at((1.3, 1.2, 0.3), 0.3)
    points = np.random.default_rng(2).uniform((0.01, 0.01, 0.01), (1.99, 1.99, 0.99), (3000, 3))
    dense, bricks = (place_in_field(each, moved) for each in (field, convert_to_bricks(field)))
    for unknown in UnknownSpace:
        found = density_at(planning_field(bricks, unknown), points)
        np.testing.assert_allclose(found, density_at(planning_field(dense, unknown), points), rtol=1e-3, atol=1e-3)


def test_the_ground_truth_moves_its_part_along() -> None:
    stone = trimesh.creation.box((0.2, 0.2, 0.4))
    stone.apply_translation((0.5, 0.5, 0.25))
    floor = trimesh.creation.box((2, 2, 0.1))
    mesh = trimesh.util.concatenate([stone, floor])
    scene = Scene("yard", "Yard", mesh, (stone, floor), Box.of((0, 0, 0), (2, 2, 1)), (1, 1, 1), ())
    moved = place_in_scene(scene, placed_at((1.3, 1.2, 0.3)))
    volume = sum(solid.volume for solid in moved.solids)
    assert volume == pytest.approx(stone.volume + floor.volume, rel=1e-3)
    at = np.array([[0.5, 0.5, 0.3], [1.3, 1.2, 0.3]])
    held = np.any([solid.contains(at) for solid in moved.solids], 0)
    assert held.tolist() == [False, True]
    assert moved.paint is not None and len(moved.mesh.faces) == len(mesh.faces) == len(moved.paint.image_of_face)
    assert moved.mesh.bounds[1][0] == pytest.approx(1.4)


def test_a_volume_that_holds_nothing_is_one_sentence() -> None:
    empty = Obstacle("part 1", CutOut(Sphere(0.1), (1.5, 1.5, 0.7)), (1.0, 1.0, 0.5))
    with pytest.raises(InvalidInputError, match="the volume of 'part 1' holds nothing of the place"):
        require_placeable(stone_field(), empty)
    require_placeable(stone_field(), placed_at((1, 1, 0.5)).obstacles[0])


def test_files_hold_cut_outs(tmp_path: Path) -> None:
    path = tmp_path / "parts.yaml"
    path.write_text("obstacles: [{cut_out: {sphere: 0.2, position: [1, 0, 0]}, position: [2, 0, 0]}]")
    (found,) = read_obstacles(path).obstacles
    assert found.shape == CutOut(Sphere(0.2), (1.0, 0.0, 0.0)) and found.position == (2.0, 0.0, 0.0)
    path.write_text("obstacles: [{cut_out: {position: [1, 0, 0]}}]")
    with pytest.raises(InvalidInputError, match="the volume of a cut-out is one of box, sphere, and this one has none"):
        read_obstacles(path)
