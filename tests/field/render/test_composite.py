"""Composite fields: what is put together is the sum of what was put in, wherever it stands."""

import math

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.field.core.protocol import FastDensity, Field, density_and_gradient
from nerfnav.field.models.analytic import BallsField
from nerfnav.field.render.composite import CompositeField, PlacedField
from nerfnav.field.render.volume_rendering import render_rays
from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Pose
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.solvers.fast import plan_fast
from nerfnav.planner.steps import PlanOutcome
from nerfnav.robots.state import RigidState
from tests.field.fields import BOX, ball, random_rays, random_voxels
from tests.planner.places import ROBOT


def pose(seed: int) -> Pose:
    """A pose that turns and moves by a lot."""
    generator = torch.Generator().manual_seed(seed)
    turn = so3.exp(torch.randn(3, generator=generator))
    return Pose(turn, 0.4 * torch.randn(3, generator=generator))


def still() -> Pose:
    return Pose(torch.eye(3), torch.zeros(3))


def points(count: int = 400, seed: int = 3) -> torch.Tensor:
    return torch.rand(count, 3, generator=torch.Generator().manual_seed(seed)) * 3 - 1.5


def two() -> CompositeField:
    return CompositeField((PlacedField(random_voxels(0), pose(1)), PlacedField(ball(), pose(2))))


def test_a_composite_is_a_field_with_a_fast_density() -> None:
    assert isinstance(two(), Field) and isinstance(two(), FastDensity)


def test_densities_add_and_colours_mix_by_density() -> None:
    field, at = two(), points()
    directions = torch.nn.functional.normalize(points(seed=4), dim=-1)
    density, mixed = torch.zeros(len(at)), torch.zeros(len(at), 3)
    for part in field.parts:
        local = torch.stack([part.pose.rotation.T @ (p - part.pose.position) for p in at])
        along = torch.stack([part.pose.rotation.T @ d for d in directions])
        there = part.field.density(local)
        density += there
        mixed += there[:, None] * part.field.radiance(local, along)
    torch.testing.assert_close(field.density(at), density, rtol=1e-4, atol=1e-4)
    solid = density > 0.1
    assert solid.sum() > 50
    torch.testing.assert_close(
        field.radiance(at, directions)[solid], (mixed / density[:, None])[solid], rtol=1e-3, atol=1e-3
    )


def test_a_field_with_the_identity_pose_is_the_field() -> None:
    voxels = random_voxels()
    field = CompositeField((PlacedField(voxels, still()),))
    rays = random_rays(300)
    torch.testing.assert_close(field.box.lower, voxels.box.lower)
    torch.testing.assert_close(field.density(points()), voxels.density(points()))
    mine, own = field.samples(*rays), voxels.samples(*rays)
    assert mine.step == own.step
    torch.testing.assert_close(mine.mask.sum(1), own.mask.sum(1))
    torch.testing.assert_close(render_rays(field, *rays).color, render_rays(voxels, *rays).color, rtol=0, atol=2e-4)


def test_turned_there_and_back_is_where_it_was() -> None:
    voxels, there = random_voxels(), pose(5)
    back = Pose(there.rotation.T, -there.rotation.T @ there.position)
    inner = CompositeField((PlacedField(voxels, there),))
    twice = CompositeField((PlacedField(inner, back),))
    inside = points()[voxels.box.contains(1.001 * points())]
    torch.testing.assert_close(twice.density(inside), voxels.density(inside), rtol=1e-3, atol=1e-3)


def test_a_moved_world_looks_the_same_from_a_moved_camera() -> None:
    field, moved = ball(), pose(7)
    placed = CompositeField((PlacedField(field, moved),))
    origins, directions = random_rays(200)
    seen = render_rays(placed, origins @ moved.rotation.T + moved.position, directions @ moved.rotation.T)
    # the axis-aligned box around the turned one is larger: rays enter it elsewhere, and samples stand elsewhere
    torch.testing.assert_close(seen.color, render_rays(field, origins, directions).color, rtol=0, atol=0.03)


def test_gradients_agree_with_finite_differences() -> None:
    field, at = two(), points(60).double().numpy()
    density, gradient = density_and_gradient(field, at)
    for axis in range(3):
        step = np.eye(3)[axis] * 1e-6
        ahead, behind = density_and_gradient(field, at + step)[0], density_and_gradient(field, at - step)[0]
        slope = (ahead - behind) / 2e-6
        smooth = np.abs(slope - gradient[:, axis]) < 1e-2 * (1 + np.abs(slope))
        assert smooth.mean() > 0.9  # the others lie at a border of a cell, or are rounded: balls are in float32
    torch.testing.assert_close(torch.from_numpy(density).float(), field.density(torch.from_numpy(at).float()))


def test_moving_a_part_moves_its_box_and_leaves_the_first_composite_alone() -> None:
    field = two()
    far = field.moved(1, Pose(torch.eye(3), torch.tensor([5.0, 0, 0])))
    assert far.box.upper[0] == pytest.approx(5 + BOX.upper[0].item())
    assert field.box.upper[0] < 4
    assert far.density(torch.tensor([[5.0, 0, 0]])) > 100 > field.density(torch.tensor([[5.0, 0, 0]]))


@pytest.mark.parametrize("at", [(0.0, 0.0, 0.4), (0.1, 0.15, 0.45)])
def test_plans_lead_around_an_obstacle_wherever_it_was_moved(at: tuple[float, float, float]) -> None:
    room = BallsField(Box.of((-1, -1, 0), (1, 1, 1)), torch.zeros(0, 3), torch.zeros(0))
    stone = BallsField(Box.of((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3)), torch.zeros(1, 3), torch.tensor([0.2]))
    field = CompositeField((PlacedField(room, still()), PlacedField(stone, pose(1))))
    field = field.moved(1, Pose(pose(1).rotation, torch.tensor(at)))
    start, goal = RigidState.at_rest((-0.7, 0.02, 0.4)), RigidState.at_rest((0.7, 0.0, 0.5))
    last = run_steps(plan_fast(PlanProblem(field, ROBOT, start, goal)))
    assert last.outcome is PlanOutcome.CONVERGED
    assert (last.motion.states.position - torch.tensor(at)).norm(dim=-1).min() > 0.2
    assert last.cost.collision < 0.1


@pytest.mark.parametrize("rotation", [2 * torch.eye(3), -torch.eye(3), torch.full((3, 3), math.nan)])
def test_a_pose_that_is_not_rigid_is_refused(rotation: torch.Tensor) -> None:
    with pytest.raises(InvalidInputError, match="rotation"):
        CompositeField((PlacedField(ball(), Pose(rotation, torch.zeros(3))),))


def test_a_composite_of_nothing_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="at least one"):
        CompositeField(())
