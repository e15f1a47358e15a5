"""The page of a flight."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav.export.formats import FORMATS
from nerfnav.export.recording import Recording
from nerfnav.export.replay import Surface, replay
from nerfnav.geometry import to_srgb
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav_app.places.surface_glb import encode_textured_glb
from tests.export.flights import flight, flown, plan
from tests.field.fields import painted


def shown(recording: Recording) -> dict:
    """What a page shows."""
    page = replay(recording).content.decode()
    found = re.search(r"^const replay = (.*);$", page, re.MULTILINE)
    assert found is not None
    return json.loads(found[1])


BALL = trimesh.creation.icosphere(subdivisions=4)
COLORS = (127 + 60 * BALL.vertices).astype(np.uint8)


def surface_glb() -> bytes:
    """A coloured ball."""
    return encode_textured_glb(painted(BALL, COLORS))


def test_the_page_shows_what_was_flown() -> None:
    data, steps = shown(flight()), flown()
    assert data["outcome"] == "the robot touched the ground-truth mesh" and data["title"] == "a helix"
    for reported, step in zip(data["steps"], steps, strict=True):
        np.testing.assert_allclose(reported["truth"][:3], step.truth.position, atol=1e-5)
        np.testing.assert_allclose(np.reshape(reported["truth"][3:], (3, 3)), step.truth.rotation, atol=1e-5)
        np.testing.assert_allclose(reported["belief"][:3], step.belief.mean.position, atol=1e-5)
        np.testing.assert_allclose(np.reshape(reported["plan"], (-1, 3)), step.plan.states.position, atol=1e-5)
        assert reported["touched"] == step.touched and (reported["picture"] is None) == (step.image is None)


def test_a_page_needs_nothing_from_anywhere_and_names_cannot_break_out_of_its_script() -> None:
    title = "</script><script>alert(1)</script>"
    page = replay(Recording.of_flight(flown(), Quadrotor(), title)).content.decode()
    assert page.count("<script>") == page.count("</script>") == 1
    assert not re.search(r"(src|href)=\"(?!data:)|https?://|@import|url\((?!data:)", page)
    assert shown(Recording.of_flight(flown(), Quadrotor(), title))["title"] == title


def test_the_place_stands_in_the_page_as_it_is() -> None:
    glb = surface_glb()
    packed = shown(flight().with_surface(glb))["surface"]
    assert set(packed) == {"points", "colors", "triangles", "low", "size"}
    surface = Surface.of_glb(glb)
    np.testing.assert_allclose(surface.points, BALL.vertices, atol=1e-6)
    np.testing.assert_allclose(255 * to_srgb(surface.colors), COLORS, atol=8)
    assert shown(flight())["surface"] is None


def test_a_thinned_surface_is_still_the_same_shape_and_colour() -> None:
    surface = Surface.of_glb(surface_glb())
    thin = surface.thinned(400)
    assert 100 < len(thin.points) <= 400 and len(thin.triangles) > 200
    np.testing.assert_allclose(np.linalg.norm(thin.points, axis=-1), 1.0, atol=0.05)
    srgb = np.where(thin.colors <= 0.0031308, 12.92 * thin.colors, 1.055 * thin.colors ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(srgb, (127 + 60 * thin.points) / 255, atol=0.08)
    assert surface.thinned(10**6) is surface


def test_what_is_no_coloured_model_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="no binary glTF"):
        Surface.of_glb(b"a picture")


def test_a_plan_cannot_be_replayed() -> None:
    with pytest.raises(InvalidInputError, match="fly the plan first"):
        replay(plan())


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_takes_a_flight_and_a_plan_or_says_why_not(name: str) -> None:
    form, place = FORMATS[name], (47.4, 8.5, 500.0)
    assert form.make(replace(flight(), datum=place)).content and form.purpose and form.ending
    if form.flights_only:
        with pytest.raises(InvalidInputError, match="plan"):
            form.exported(plan())
    else:
        assert form.make(replace(plan(), datum=place)).content
