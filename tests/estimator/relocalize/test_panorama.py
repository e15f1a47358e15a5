"""Panoramas, and where pictures fit into them."""

import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.estimator.relocalize.panorama import (
    COLUMN,
    Panoramas,
    _directions,
    _laid,
    find_free_places,
    list_tilts,
    thin_places,
)
from nerfnav.field.render.volume_rendering import render_image, render_rays
from nerfnav.geometry.camera import FORWARD_MOUNT, Pose
from nerfnav.geometry.so3 import from_yaw
from tests.estimator.places import BOX, CAMERA, balls

PLACES = torch.tensor([[-0.5, 0.0, 0.25], [-0.3, 0.3, 0.3], [0.3, 0.35, 0.2], [0.3, 0.1, 0.6]])
EXPOSURE = (1e-3, 1e-3)
TILTS = list_tilts((-0.3, 0.0, 0.3), (0.0, 0.25))
AHEAD = CAMERA.directions(CAMERA.pixels()) @ FORWARD_MOUNT.rotation.T


def colors_from(place: int, tilt: int, heading: int) -> torch.Tensor:
    rotation = from_yaw(torch.tensor(heading * COLUMN)) @ TILTS[tilt] @ FORWARD_MOUNT.rotation
    return render_image(balls(), CAMERA, Pose(rotation, PLACES[place])).color.reshape(-1, 3)


def best_of(misfit: torch.Tensor) -> tuple[int, ...]:
    return tuple(int(index) for index in torch.unravel_index(misfit.argmin(), misfit.shape))


def test_a_picture_fits_best_where_it_was_taken_whatever_its_exposure() -> None:
    panoramas = run_steps(Panoramas.render(balls(), PLACES))
    for where in ((0, 2, 0), (1, 3, 63), (2, 1, 30)):
        colors = colors_from(*where)
        for exposed in (colors, 0.7 * colors + 0.1):
            misfit = panoramas.misfit(exposed, AHEAD, TILTS, EXPOSURE)
            assert misfit.shape == (4, 6, 64)
            assert best_of(misfit) == where
            assert misfit[where] < 0.3 * exposed.var()


def test_a_misfit_is_the_least_over_gain_and_bias_each_at_its_price() -> None:
    panoramas, colors = run_steps(Panoramas.render(balls(), PLACES)), 0.8 * colors_from(1, 3, 7) + 0.1
    weight, told = _laid(colors, AHEAD @ TILTS[3].T)
    price = (0.02, 0.3)
    misfit = panoramas.misfit(colors, AHEAD, TILTS[3:4], price)
    directions = _directions().reshape(-1, 3)
    for place, heading in ((1, 7), (2, 40)):
        cells = render_rays(balls(), PLACES[place].expand_as(directions), directions).color.reshape(24, 64, 3)
        shown = cells.roll(-heading, 1)[weight > 0].double()
        gain = torch.stack([shown.flatten(), torch.ones(shown.numel())], 1)
        share = (weight[weight > 0] / weight.sum() / 3).double().repeat_interleave(3)
        off = (told[weight > 0] - shown).flatten()
        normal = gain.T @ (share[:, None] * gain) + torch.diag(torch.tensor(price)).double()
        best = torch.linalg.solve(normal, gain.T @ (share * off))
        left = (share * (off - gain @ best).square()).sum() + (torch.tensor(price) * best.square()).sum()
        assert float(misfit[place, 0, heading]) == pytest.approx(float(left), abs=1e-5)


def test_a_picture_of_hardly_any_contrast_fits_where_the_field_shows_as_little() -> None:
    away = torch.tensor([[-0.9, -0.9, 0.9]])
    panoramas = run_steps(Panoramas.render(balls(), torch.cat([PLACES, away])))
    sky = balls().background.expand(len(AHEAD), 3)
    misfit = panoramas.misfit(sky, AHEAD, TILTS, EXPOSURE)
    shown = panoramas.misfit(colors_from(0, 2, 0), AHEAD, TILTS, EXPOSURE)
    assert misfit.min() < 1e-4 and misfit.flatten(1).amax(1)[:-1].min() > 1e-3, "any place explains it"
    assert shown.min() >= -1e-5


def test_turning_a_picture_by_a_column_turns_its_misfit() -> None:
    panoramas, colors = run_steps(Panoramas.render(balls(), PLACES)), colors_from(0, 2, 0)
    turned = AHEAD @ from_yaw(torch.tensor(5 * COLUMN)).T
    here = panoramas.misfit(colors, AHEAD, TILTS[2:3], EXPOSURE)
    there = panoramas.misfit(colors, turned, TILTS[2:3], EXPOSURE)
    torch.testing.assert_close(there, here.roll(-5, -1), atol=1e-4, rtol=0)


def test_free_places_are_in_the_box_and_have_no_density_around() -> None:
    places = find_free_places(balls(), 0.2)
    assert BOX.contains(places).all()
    assert (balls().density(places) < 1).all()
    assert len(places) > 20


def test_places_are_thinned_until_there_are_few_enough() -> None:
    places = find_free_places(balls(), 0.1)
    few = thin_places(places, 0.1, 50)
    assert 20 < len(few) <= 50
    assert len(torch.unique(torch.cat([places, few]), dim=0)) == len(places), "all are places that were given"
