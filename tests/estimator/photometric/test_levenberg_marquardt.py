"""The compiled descent against its reference in torch."""

from dataclasses import replace

import pytest
import torch

from nerfnav.estimator.photometric.levenberg_marquardt import (
    Guess,
    NewtonConfig,
    Prior,
    evaluate,
    improve,
    join_information,
    minimise,
)
from nerfnav.estimator.photometric.residuals import Observation, residuals
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.surroundings import Surroundings
from nerfnav.geometry import so3
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera, Pose
from tests.field.fields import random_voxels_in_a_room
from tests.field.render.test_jacobian import cloud

CAMERA = Camera.from_fov(16, 12, 60)
MOUNT = replace(FORWARD_MOUNT, position=torch.tensor([0.05, 0.02, 0.03]))
TRUTH = Pose(so3.from_yaw(torch.tensor(3.3)), torch.tensor([0.9, 0.1, 0.05]))


def seen(around: Surroundings | None = None) -> Observation:
    """What a camera beside a cloud sees of it, and of what is around it."""
    field = replace(cloud(), outside=around)
    color = field.render_rays(*CAMERA.rays(TRUTH.compose(MOUNT))).color
    return Observation(field, CAMERA, MOUNT, CAMERA.pixels(), 0.9 * color + 0.02)


def starts(count: int) -> Guess:
    generator = torch.Generator().manual_seed(0)
    draws = 0.02 * torch.randn(count, 6, generator=generator)
    rotation = so3.retract(TRUTH.rotation.expand(count, 3, 3), draws[:, 3:])
    return Guess.at(Pose(rotation, TRUTH.position + draws[:, :3]))


def prior(known: bool, slack: float = 0.0) -> Prior:
    information = join_information(1e3 * torch.eye(6) if known else None, (0.1, 0.05))
    return Prior(information, starts(1).pose[0] if known else None, 50.0, slack)


@pytest.fixture
def whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Descents see what is faint too, as the reference does."""
    monkeypatch.setattr(VoxelField, "ray_grid", property(lambda field: field.exact_ray_grid))


@pytest.mark.usefixtures("whole")
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("robust", "slack"), [(1.0, 0.0), (0.02, 0.0), (0.02, 1.0)])
def test_every_stage_is_that_of_the_reference(known: bool, robust: float, slack: float) -> None:
    config = NewtonConfig(6, robust=robust, stretch=2.0)
    found = list(improve(seen(), starts(3), prior(known, slack), config))
    with torch.no_grad():
        expected = list(minimise(seen(), starts(3), prior(known, slack), config))
    assert len(found) == len(expected) == 7
    for mine, reference in zip(found[:4], expected[:4], strict=True):
        torch.testing.assert_close(mine.cost, reference.cost, rtol=2e-3, atol=1e-4)
        torch.testing.assert_close(mine.guess.pose.position, reference.guess.pose.position, rtol=0, atol=1e-4)
        torch.testing.assert_close(mine.guess.exposure, reference.guess.exposure, rtol=0, atol=1e-3)
    first, reference = found[0], expected[0]
    for name in ("seen", "known", "slope", "change", "residual", "process"):
        mine, theirs = getattr(first, name), getattr(reference, name)
        assert (mine - theirs).norm() <= 2e-3 * theirs.norm() + 1e-6, name
    assert (found[-1].cost < 0.2 * found[0].cost).all()


@pytest.mark.usefixtures("whole")
def test_a_descent_among_surroundings_is_that_of_the_reference() -> None:
    around, config = random_voxels_in_a_room().outside, NewtonConfig(6, robust=0.3)
    *_, found = improve(seen(around), starts(3), prior(True), config)
    with torch.no_grad():
        *_, expected = minimise(seen(around), starts(3), prior(True), config)
    torch.testing.assert_close(found.cost, expected.cost, rtol=5e-3, atol=1e-4)
    torch.testing.assert_close(found.guess.pose.position, expected.guess.pose.position, rtol=0, atol=3e-4)
    again = list(improve(seen(around), found.guess, prior(True), NewtonConfig(0, robust=0.3)))[-1]
    torch.testing.assert_close(found.cost, again.cost, rtol=1e-4, atol=1e-6)  # from the camera on


def test_a_descent_that_leaves_out_what_is_faint_ends_where_the_whole_one_does() -> None:
    *_, thrifty = improve(seen(), starts(3), prior(True), NewtonConfig(12, settled=1e-4))
    with torch.no_grad():
        *_, expected = minimise(seen(), starts(3), prior(True), NewtonConfig(12, settled=1e-4))
    field = cloud()
    apart = (thrifty.guess.pose.position - expected.guess.pose.position).norm(dim=-1)
    assert (apart < 0.05 * field.spacing.min()).all()  # though this one has no surface that is not faint
    least, whole = field.ray_grid[8], field.exact_ray_grid[8]
    assert whole < least < field.values[..., 0].max()
    assert (field.ray_grid[1] > 0).sum() >= (field.exact_ray_grid[1] > 0).sum()


def test_steep_colours_count_less_where_surfaces_may_be_misplaced() -> None:
    with torch.no_grad():
        _, trust = evaluate(seen(), starts(1), prior(False, 1.0), 1.0)
        _, plain = evaluate(seen(), starts(1), prior(False), 1.0)
        slopes = seen().linearised(starts(1).pose)[1][..., :3].square().sum(-1).flatten()
    assert (plain == 1).all() and 0 < trust.min() < 0.9 < 1.1 < trust.max()
    torch.testing.assert_close(trust.mean(), torch.tensor(1.0))
    assert trust[0, slopes.argmax()] == trust.min() and trust[0, slopes.argmin()] == trust.max()


@pytest.mark.usefixtures("whole")
def test_a_glance_shows_what_a_descent_starts_from() -> None:
    around = random_voxels_in_a_room().outside
    for view in (seen(), seen(around)):
        (first,) = improve(view, starts(3), prior(True), NewtonConfig(0))
        torch.testing.assert_close(residuals(view, starts(3).pose), first.residual, rtol=0, atol=1e-4)


def test_costs_never_rise_and_a_pose_that_has_settled_stays() -> None:
    stages = list(improve(seen(), starts(4), prior(True), NewtonConfig(12, settled=1e-3)))
    costs = torch.stack([stage.cost for stage in stages])
    assert (costs.diff(dim=0) <= 0).all() and (stages[-1].moved < 1e-3).all()
    ends = stages[-1].guess.pose.position
    assert (ends - ends[0]).norm(dim=-1).max() < 0.01 < (starts(4).pose.position - ends).norm(dim=-1).max()


@pytest.mark.usefixtures("whole")
def test_a_step_too_small_to_matter_is_taken_without_looking_and_leads_where_the_next_look_would():
    config = NewtonConfig(12, settled=2e-3)
    *_, before, found = improve(seen(), starts(1), prior(True), config)
    with torch.no_grad():
        *_, expected = minimise(seen(), starts(1), prior(True), config)
    torch.testing.assert_close(found.guess.pose.position, expected.guess.pose.position, rtol=0, atol=1e-4)
    torch.testing.assert_close(found.process, expected.process, rtol=1e-2, atol=1e-4)
    assert 0 < found.moved < 2e-3 and torch.equal(found.residual, before.residual)
    (looked,) = improve(seen(), found.guess, prior(True), NewtonConfig(0))
    assert looked.cost <= before.cost
    torch.testing.assert_close(found.process, looked.process, rtol=1e-4, atol=1e-6)
    torch.testing.assert_close(found.change, looked.change, rtol=1e-4, atol=1e-6)


def test_rays_that_begin_near_the_last_surface_end_where_rays_from_the_camera_do() -> None:
    one = list(improve(seen(), starts(1), prior(True), NewtonConfig(8)))[-1]
    again = list(improve(seen(), one.guess, prior(True), NewtonConfig(0)))[-1]  # from the camera on
    torch.testing.assert_close(one.cost, again.cost, rtol=1e-4, atol=1e-6)


class Bent:
    """Two pixels whose colours are x and x^2 / 2 - 0.8, held against black: by what Gauss and Newton leave out, each
    step leaves 0.8 of x."""

    colors = torch.zeros(2, 3)

    def linearised(self, poses: Pose) -> tuple[torch.Tensor, torch.Tensor]:
        x = poses.position[:, :1, None]
        by_pose = torch.zeros(len(x), 2, 3, 6)
        by_pose[..., 0] = torch.cat([torch.ones_like(x), x], 1)
        return torch.cat([x, 0.5 * x.square() - 0.8], 1).expand(-1, 2, 3), by_pose


def bent_end(steps: int, stretch: float) -> tuple[float, torch.Tensor]:
    """Where a descent of so many steps from 0.1 ends, and its costs."""
    start = Guess.at(Pose(torch.eye(3)[None], torch.tensor([[0.1, 0.0, 0.0]])))
    config = NewtonConfig(steps, robust=10.0, stretch=stretch)
    stages = [*minimise(Bent(), start, Prior(join_information(None, (0.0, 0.0))), config)]
    return abs(float(stages[-1].guess.pose.position[0, 0])), torch.stack([stage.cost for stage in stages])


def test_steps_that_would_go_on_for_long_are_stretched() -> None:
    (found, costs), (plain, _) = bent_end(6, 2.0), bent_end(6, 1.0)
    assert plain == pytest.approx(0.1 * 0.8**6, rel=0.1)
    assert found < 0.4 * plain and (costs.diff(dim=0) <= 0).all()
