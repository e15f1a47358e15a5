"""Light that adds up, and what pictures hold of it."""

import numpy as np
import pytest

from nerfnav.geometry.color import to_linear, to_srgb


def test_what_was_encoded_is_decoded_to_the_same() -> None:
    share = np.linspace(0, 1, 2001).reshape(3, -1)
    np.testing.assert_allclose(to_linear(to_srgb(share)), share, atol=1e-6)  # the standard's own numbers are rounded
    np.testing.assert_allclose(to_srgb(to_linear(share)), share, atol=1e-6)


def test_a_fifth_of_the_light_looks_half_as_bright() -> None:
    assert to_linear(np.array([0.0, 0.5, 1.0])) == pytest.approx([0.0, 0.21404, 1.0], abs=1e-5)


def test_the_straight_part_joins_the_curve() -> None:
    assert np.diff(to_srgb(np.array([0.0031308, 0.00313081]))) == pytest.approx(0, abs=1e-6)
    assert np.diff(to_linear(np.array([0.04045, 0.0404501]))) == pytest.approx(0, abs=1e-6)
