"""Searches that begin where a capture's photographs were taken."""

import math
from dataclasses import replace
from functools import cache

import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.estimator.relocalize.capture_prior import (
    decode_views,
    encode_views,
    list_places_near,
    list_tilts_near,
    transform_views,
)
from nerfnav.estimator.relocalize.global_localization import RelocaliseConfig, RelocaliseOutcome
from nerfnav.estimator.relocalize.localizer import GlobalLocalizer
from nerfnav.estimator.relocalize.panorama import PanoramaConfig
from nerfnav.field import FieldInfo, VoxelField
from nerfnav.field.models.levels import raw_of
from nerfnav.field.models.voxel import DENSITY_SCALE
from nerfnav.geometry import FORWARD_MOUNT, Box, Pose, so3
from nerfnav.geometry.similarity import Similarity
from nerfnav.robots.state import RigidState
from tests.estimator.places import CAMERA, COLOR_STD, collect, draws, picture, voxel_balls

CONFIG = RelocaliseConfig(
    PanoramaConfig(spacing=0.12, levels=2), halvings=(1, 0), kept=(24, 3), iterations=(8, 12), robust=(0.2, 0.15)
)
NOISE = ColorNoise(std=COLOR_STD)
LYING = torch.tensor([0.0] * 6 + [math.pi / 2, 0.0, 0.0] + [0.0] * 3)
"""A camera on its side."""
TRUTH = RigidState.at_rest((-0.35, 0.05, 0.28), 0.1).retract(LYING)


def lying_views() -> Pose:
    """Cameras on their sides, around the truth."""
    places = [(-0.45, 0.15, 0.3, 0.0), (-0.3, -0.1, 0.25, 0.3), (-0.5, -0.05, 0.3, 0.1), (-0.2, 0.1, 0.3, 0.0)]
    states = RigidState.stack([RigidState.at_rest(place[:3], place[3]).retract(LYING) for place in places])
    return Pose(states.rotation @ FORWARD_MOUNT.rotation, states.position)


@cache
def searcher(views: bool) -> GlobalLocalizer:
    config = CONFIG.for_field(FieldInfo(views=encode_views(lying_views()))) if views else CONFIG
    return GlobalLocalizer(voxel_balls(), CAMERA, NOISE, config)


def test_poses_are_remembered_as_numbers() -> None:
    views = lying_views()
    again = decode_views(encode_views(views))
    assert torch.allclose(again.position, views.position, atol=1e-5)
    assert torch.allclose(again.rotation, views.rotation, atol=1e-4)
    many = Pose(views.rotation.repeat(100, 1, 1), views.position.repeat(100, 1))
    assert len(encode_views(many)) == 7 * 200


def test_what_is_remembered_moves_with_its_place() -> None:
    change = Similarity(so3.exp(torch.tensor([0.3, -0.2, 0.5]).double()), torch.tensor([1.0, 2.0, 3.0]).double(), 2.0)
    changed = decode_views(transform_views(encode_views(lying_views()), change))
    assert torch.allclose(changed.position, change(lying_views().position), atol=1e-4)
    assert transform_views((), change) == ()


def test_a_search_begins_where_cameras_stood_and_between_them_held_as_they_were() -> None:
    views = lying_views()
    places, tilts = list_places_near(views), list_tilts_near(views)
    assert len(places) == 4 + 4 * 2 and len(tilts) == 1
    assert (torch.cdist(views.position, places).amin(1) < 1e-6).all()
    assert so3.local(tilts[0], so3.exp(torch.tensor([math.pi / 2, 0.0, 0.0]))).norm() < 1e-3
    assert len(list_places_near(views[:1])) == 1


def test_a_camera_on_its_side_is_found_where_the_capture_was_taken_like_that() -> None:
    image = picture(voxel_balls(), TRUTH, draws(0))
    last = run_steps(searcher(views=True).relocalise(image))
    assert last.outcome is RelocaliseOutcome.FOUND and last.step.fraction == 1
    assert (last.step.body_poses().position[0] - TRUTH.position).norm() < 0.02
    level = run_steps(searcher(views=False).relocalise(image))
    assert level.outcome is not RelocaliseOutcome.FOUND


def test_a_picture_that_was_taken_otherwise_is_looked_for_everywhere() -> None:
    level = RigidState.at_rest((-0.35, 0.05, 0.28), 0.1)
    steps, last = collect(searcher(views=True).relocalise(picture(voxel_balls(), level, draws(0))))
    assert last.outcome is RelocaliseOutcome.FOUND
    assert (last.step.body_poses().position[0] - level.position).norm() < 0.02
    assert [step.fraction < 1 for step in steps] == [True] * (len(steps) - 1) + [False]


def sized(scale: float) -> VoxelField:
    """The place in another unit of length: `nerfnav.field.edit.move` keeps what is solid solid, which changes
    pictures."""
    field = voxel_balls()
    raw = raw_of(DENSITY_SCALE * torch.nn.functional.softplus(field.values[..., :1]) / scale)
    box = Box(scale * field.box.lower, scale * field.box.upper)
    return replace(field, box=box, values=torch.cat([raw, field.values[..., 1:]], -1))


@pytest.mark.parametrize("scale", [0.1, 10.0])
def test_a_place_of_any_size_is_searched_alike(scale: float) -> None:
    state = RigidState.at_rest((-0.35, 0.05, 0.28), 0.1)
    image = picture(voxel_balls(), state, draws(0))
    here = run_steps(searcher(views=False).relocalise(image))
    there = run_steps(GlobalLocalizer(sized(scale), CAMERA, NOISE, CONFIG).relocalise(image))
    assert here.outcome is there.outcome is RelocaliseOutcome.FOUND
    assert (there.step.body_poses().position[0] - scale * state.position).norm() < 0.02 * scale
