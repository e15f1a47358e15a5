"""Panoramas, and where pictures fit into them."""

import torch

from nerfnav.estimator.panorama import COLUMN, Panoramas, free_places, thinned, tilts_of
from nerfnav.field.render import render_image
from nerfnav.geometry.camera import FORWARD_MOUNT, Pose
from nerfnav.geometry.so3 import from_yaw
from tests.estimator.places import BOX, CAMERA, balls

PLACES = torch.tensor([[-0.5, 0.0, 0.25], [-0.3, 0.3, 0.3], [0.3, 0.35, 0.2], [0.3, 0.1, 0.6]])
TILTS = tilts_of((-0.3, 0.0, 0.3), (0.0, 0.25))
AHEAD = CAMERA.directions(CAMERA.pixels()) @ FORWARD_MOUNT.rotation.T


def colors_from(place: int, tilt: int, heading: int) -> torch.Tensor:
    rotation = from_yaw(torch.tensor(heading * COLUMN)) @ TILTS[tilt] @ FORWARD_MOUNT.rotation
    return render_image(balls(), CAMERA, Pose(rotation, PLACES[place])).color.reshape(-1, 3)


def best_of(misfit: torch.Tensor) -> tuple[int, ...]:
    return tuple(int(index) for index in torch.unravel_index(misfit.argmin(), misfit.shape))


def test_a_picture_fits_best_where_it_was_taken_whatever_its_exposure() -> None:
    panoramas = Panoramas.of(balls(), PLACES)
    for where in ((0, 2, 0), (1, 3, 63), (2, 1, 30)):
        colors = colors_from(*where)
        for exposed in (colors, 0.7 * colors + 0.1):
            misfit = panoramas.misfit(exposed, AHEAD, TILTS)
            assert misfit.shape == (4, 6, 64)
            assert best_of(misfit) == where
            assert misfit[where] < 0.3 * exposed.var()


def test_a_picture_of_one_colour_fits_everywhere_alike() -> None:
    misfit = Panoramas.of(balls(), PLACES).misfit(torch.full((len(AHEAD), 3), 0.6), AHEAD, TILTS)
    assert misfit.abs().max() < 1e-4


def test_turning_a_picture_by_a_column_turns_its_misfit() -> None:
    panoramas, colors = Panoramas.of(balls(), PLACES), colors_from(0, 2, 0)
    turned = AHEAD @ from_yaw(torch.tensor(5 * COLUMN)).T
    here = panoramas.misfit(colors, AHEAD, TILTS[2:3])
    there = panoramas.misfit(colors, turned, TILTS[2:3])
    torch.testing.assert_close(there, here.roll(-5, -1), atol=1e-4, rtol=0)


def test_free_places_are_in_the_box_and_have_no_density_around() -> None:
    places = free_places(balls(), 0.2)
    assert BOX.contains(places).all()
    assert (balls().density(places) < 1).all()
    assert len(places) > 20


def test_places_are_thinned_until_there_are_few_enough() -> None:
    places = free_places(balls(), 0.1)
    few = thinned(places, 0.1, 50)
    assert 20 < len(few) <= 50
    assert len(torch.unique(torch.cat([places, few]), dim=0)) == len(places), "all are places that were given"
