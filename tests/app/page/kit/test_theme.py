"""Colours of the page: told apart in pairs, by deuteranopes too, and seen before the backdrop."""

import re
from importlib.resources import files
from itertools import combinations, pairwise

import numpy as np
import pytest

from nerfnav_app.page.kit import theme

# simulation of deuteranopia in linear RGB: Machado, Oliveira, Fernandes, IEEE TVCG 2009, severity 1
_DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
)
_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
_WHITE = _XYZ.sum(1)
_AXES = {"x axis": (255, 32, 96), "y axis": (32, 223, 128), "z axis": (32, 128, 255)}  # of viser's gizmos
_LINES = {name: getattr(theme, name) for name in ("START", "GOAL", "PLAN", "STALE", "TRUTH", "BELIEF", "HIT", "GUST")}
_APART = 20.0  # CIE 1976 colour difference; 2.3 is just noticed side by side


def linear(color: theme.Rgb) -> np.ndarray:
    """sRGB bytes as linear RGB, 0 to 1 (IEC 61966-2-1)."""
    share = np.array(color) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    """Linear RGB as CIE L*a*b*."""
    ratio = _XYZ @ np.clip(rgb, 0, 1) / _WHITE
    x, y, z = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def contrast(one: theme.Rgb, other: theme.Rgb) -> float:
    """Contrast ratio of WCAG 2.1, 1 to 21."""
    low, high = sorted(float(_XYZ[1] @ linear(color)) + 0.05 for color in (one, other))
    return high / low


@pytest.mark.parametrize("seen_by", [np.eye(3), _DEUTERANOPIA], ids=["most people", "deuteranopes"])
def test_lines_ends_axes_and_brand_are_told_apart(seen_by: np.ndarray) -> None:
    colors = {**_LINES, "BRAND": theme.BRAND, **_AXES}
    seen = {name: lab(seen_by @ linear(color)) for name, color in colors.items()}
    # red is danger, on a body and on the thin x axis alike; axes are viser's own
    pairs = [pair for pair in combinations(seen, 2) if not set(pair) <= {"HIT", *_AXES}]
    near = {pair: np.linalg.norm(seen[pair[0]] - seen[pair[1]]) for pair in pairs}
    assert min(near.values()) > _APART, min(near, key=near.__getitem__)


def test_the_replay_has_the_colours_of_the_page() -> None:
    page = (files("nerfnav.export") / "replay.html").read_text()
    told = dict(re.findall(r"--(truth|belief|plan|hit): (#[0-9a-f]{6});", page))
    assert told == {name.lower(): theme.css(_LINES[name]) for name in ("TRUTH", "BELIEF", "PLAN", "HIT")}
    assert set(re.findall(r'rgb\("(\w+)"\)', page)) == set(told), "its lines are drawn in other colours"


@pytest.mark.parametrize("name", _LINES)
def test_what_is_drawn_is_seen_before_the_backdrop(name: str) -> None:
    for backdrop in theme.night()[[0, -1], 0]:
        assert contrast(_LINES[name], tuple(backdrop.tolist())) > 3


def test_white_is_read_on_the_brand() -> None:
    assert contrast(theme.BRAND, (255, 255, 255)) > 4.5


@pytest.mark.parametrize("seen_by", [np.eye(3), _DEUTERANOPIA], ids=["most people", "deuteranopes"])
def test_the_scale_of_clearance_grows_darker_and_its_steps_are_told_apart_and_seen(seen_by: np.ndarray) -> None:
    seen = [lab(seen_by @ linear(color)) for color in theme.SCALE]
    assert all(one[0] > other[0] for one, other in pairwise(seen)), "brightness alone does not tell where it is"
    assert all(np.linalg.norm(one - other) > _APART for one, other in combinations(seen, 2))
    for backdrop in theme.night()[[0, -1], 0]:
        assert min(contrast(color, tuple(backdrop.tolist())) for color in theme.SCALE) > 3


def test_what_is_beyond_the_scale_has_the_colour_of_its_end() -> None:
    shares = np.array([-1.0, 0.0, 1.0, 7.0])
    assert theme.on_scale(shares).tolist() == [list(theme.SCALE[end]) for end in (0, 0, -1, -1)]
