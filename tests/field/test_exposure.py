"""Photographs of different exposure."""

from dataclasses import replace

import pytest
import torch

from nerfnav.field.exposure import gains
from nerfnav.field.rays import RaySampler
from nerfnav.field.render import render_image
from tests.field.fields import photographs_of_ball, random_voxels


def test_the_gains_of_photographs_are_found_from_the_field_that_they_show() -> None:
    field, views = random_voxels(), photographs_of_ball(4, size=32)
    true = torch.tensor([0.8, 1.0, 1.1, 1.25])
    shown = [render_image(field, views.camera, views.poses[k]).color for k in range(4)]
    images = torch.stack([255 * gain * 0.7 * color for gain, color in zip(true, shown, strict=True)]).clamp(0, 255)
    found = gains(field, replace(views, images=images.to(torch.uint8)))
    assert found.log().mean().item() == pytest.approx(0.0, abs=1e-5)
    torch.testing.assert_close(found, true / true.log().mean().exp(), atol=0.03, rtol=0)


def test_a_corrected_sampler_gives_colours_of_one_exposure() -> None:
    views = photographs_of_ball(3, size=8)
    plain, corrected = (RaySampler(views, torch.Generator().manual_seed(0)) for _ in range(2))
    corrected.correct(torch.tensor([2.0, 2.0, 2.0]))
    one, other = plain.draw(100), corrected.draw(100)
    assert (one.origins == other.origins).all()
    assert one.targets == pytest.approx(2 * other.targets, abs=1e-6)
