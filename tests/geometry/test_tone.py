"""Tone mapping and its inverse."""

import numpy as np

from nerfnav.geometry.color import invert_tone_map, to_linear, to_srgb, tone_map


def shown(srgb: np.ndarray) -> np.ndarray:
    """What a viewer displays for the light that should be displayed as sRGB bytes."""
    return 255 * to_srgb(tone_map(invert_tone_map(to_linear(srgb / 255))))


def test_greys_are_displayed_as_three_js_displays_them():
    grey = to_linear(np.repeat([[40.0], [120], [200], [255]], 3, axis=1) / 255)
    np.testing.assert_allclose(255 * to_srgb(tone_map(grey))[:, 0], [22, 130, 204, 226], atol=1)


def test_colours_of_photographs_are_displayed_as_they_are():
    srgb = np.random.default_rng(0).uniform(40, 200, (1000, 3))
    pure = srgb.max(1) - srgb.min(1) > 0.65 * srgb.max(1)
    np.testing.assert_allclose(shown(srgb[~pure]), srgb[~pure], atol=1)


def test_what_is_bright_and_pure_comes_out_darker_and_not_pale():
    purest = shown(255 * np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]))
    assert (np.diag(purest) > 180).all() and (purest[~np.eye(3, dtype=bool)] < 100).all()
    assert shown(np.full((1, 3), 255.0)).min() > 245
