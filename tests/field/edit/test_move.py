"""Fields that are moved without training again: the same pictures, and no free space that was not there."""

import math
from dataclasses import replace

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.occupancy import Occupancy, raw_of
from nerfnav.field.core.protocol import density_and_gradient
from nerfnav.field.edit.move import move_field
from nerfnav.field.models.analytic import BallsField
from nerfnav.field.models.neural import NeuralField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav.geometry.similarity import Similarity
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.planner.space.scales import threshold_of
from nerfnav.robots.body import Body
from tests.field.models.test_neural import random_field
from tests.field.moves import after, change, freed, likeness, room


class OtherField(BallsField):
    """A field that could be stored, had it a codec."""

    info, step = FieldInfo(), 0.1

    def __init__(self) -> None:
        super().__init__(Box.of((-1, -1, 0), (1, 1, 1)), torch.zeros(1, 3), torch.tensor([0.2]))


QUARTER = change((torch.pi / 2, 0.0, 0.0))


@pytest.mark.parametrize("outside", [False, True])
@pytest.mark.parametrize("similarity", [change(shift=1.5), QUARTER])
def test_shifts_and_quarter_turns_lose_nothing(similarity: Similarity, outside: bool) -> None:
    field = room(outside=outside)
    now = after(field, similarity)
    assert likeness(field, now, similarity, outside) > 60
    assert sorted(now.shape) == sorted(field.shape)
    assert freed(field, now, similarity) == (0, 0)


@pytest.mark.parametrize("evidence", [True, False])
@pytest.mark.parametrize("scale", [0.1, 0.5, 2.0, 10.0, 30.0])
def test_scaled_places_look_the_same_and_stay_solid(scale: float, evidence: bool) -> None:
    field, similarity = room(evidence), change(scale=scale)
    now = after(field, similarity)
    assert likeness(field, now, similarity) > (40 if evidence else 32)  # else more is made dense
    won, lost = freed(field, now, similarity)
    assert won == 0 and lost < 0.15  # a voxel along all surfaces
    torch.testing.assert_close(now.box.size, scale * field.box.size)


def test_densities_are_per_metre() -> None:
    field = room(evidence=False)
    now = after(field, change(scale=0.5))
    nodes = field.values[..., 0] > 0
    softplus = torch.nn.functional.softplus
    torch.testing.assert_close(softplus(now.values[nodes][:, 0]), 2 * softplus(field.values[nodes][:, 0]))


@pytest.mark.parametrize("evidence", [True, False])
@pytest.mark.parametrize("similarity", [change((0.04, 0.07, 0.0)), change((0.5, -0.3, 0.8), scale=1.7, shift=0.4)])
def test_turned_places_look_alike_and_nothing_solid_gets_free(similarity: Similarity, evidence: bool) -> None:
    field = room(evidence)
    now = after(field, similarity)
    assert likeness(field, now, similarity) > (24 if evidence else 21)
    won, lost = freed(field, now, similarity)
    assert won == 0 and lost < 0.2


@pytest.mark.parametrize(("degrees", "scale"), [(3.0, 1.0), (0.0, 0.5), (0.0, 2.0), (10.0, 1.5)])
def test_what_is_solid_in_a_coarse_place_alone_stays_so(degrees: float, scale: float) -> None:
    """There planners take less dense space for solid than where nodes are near each other."""
    values = torch.full((28, 28, 20, 4), 0.5)
    values[..., 0] = -20.0
    values[10:20, 10:13, 4:14, 0], values[5:6, :, :, 0] = raw_of(3.0), raw_of(2.0)
    before = VoxelField(Box.of((0, 0, 0), (2.16, 2.16, 1.52)), values, torch.ones(3))
    turn = so3.exp(torch.tensor([math.radians(degrees), 0.0, 0.0], dtype=torch.float64))
    similarity = Similarity(turn, torch.zeros(3, dtype=torch.float64), scale)
    now = after(before, similarity)
    points = before.box.lower + torch.rand(40_000, 3, generator=torch.Generator().manual_seed(0)) * before.box.size
    solid = points[before.density(points) > threshold_of(before)]
    assert threshold_of(before) < 2 and len(solid) > 300
    inside = now.box.contains(similarity(solid))
    assert (now.density(similarity(solid))[inside] > threshold_of(now)).all()


def test_turned_surroundings_are_seen_where_they_were() -> None:
    field, similarity = room(outside=True), change((0.2, 0.1, 0.3))
    now = after(field, similarity)
    assert likeness(field, now, similarity, inside=True) > 24
    without = replace(now, outside=None)
    assert likeness(field, without, similarity, inside=True) < likeness(field, now, similarity, inside=True) - 5


def test_what_the_new_box_holds_and_the_old_did_not_is_unproven() -> None:
    now = after(room(), change((0.0, 0.0, torch.pi / 4)))
    assert now.evidence is not None
    assert (now.evidence[:3, :3] == Occupancy.UNPROVEN).all() and (now.evidence == Occupancy.FREE).any()


def test_the_map_of_planners_never_gains_a_free_voxel() -> None:
    field, similarity = room(), change((0.05, -0.08, 0.0))
    now, body = after(field, similarity), Body.box((0.1, 0.1, 0.1), (3, 3, 3))
    before, later = (OccupancyMap.of(each.planned, body) for each in (field, now))
    free = later.centers((~later.occupied).nonzero())
    back = similarity.inverted()(free)
    index = ((back - before.box.lower) / before.spacing).round().long()
    held = ((index >= 0) & (index < torch.tensor(before.occupied.shape))).all(-1)
    assert held.float().mean() > 0.99
    solid = torch.from_numpy(density_and_gradient(field.planned, back.double().numpy())[0]) > 5
    assert not solid.any()


def test_noise_grows_by_what_pictures_lose() -> None:
    field = replace(room(), info=FieldInfo(noise_std=0.02))
    turned, shifted = after(field, change((0.04, 0.07, 0.0))), after(field, change(shift=1.0))
    assert shifted.info.noise_std == 0.02
    assert turned.info.noise_std is not None and 0.02 < turned.info.noise_std < 0.1
    assert turned.info.baked_psnr_db is not None and turned.info.baked_psnr_db > 24


def test_fields_of_other_kinds_are_refused_with_what_to_do() -> None:
    with pytest.raises(InvalidInputError, match="bake it first"):
        list(move_field(OtherField(), change(scale=2.0)))


def test_networks_are_moved_without_any_loss() -> None:
    field, similarity = random_field(), change((0.5, -0.3, 0.8), scale=1.7, shift=0.4)
    now = run_steps(move_field(field, similarity))
    assert isinstance(now, NeuralField)
    points = field.box.lower + torch.rand(200, 3, generator=torch.Generator().manual_seed(0)) * field.box.size
    directions = torch.nn.functional.normalize(points + 0.1, dim=-1)
    turned = (directions.double() @ similarity.rotation.T).float()
    there = similarity(points)
    torch.testing.assert_close(1.7 * now.density(there), field.density(points), rtol=1e-3, atol=1e-4)
    seen, before = now.radiance(there, turned), field.radiance(points, directions)
    torch.testing.assert_close(seen, before, rtol=1e-3, atol=1e-4)
