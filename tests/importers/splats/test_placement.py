"""Up, scale and box of splats: guessed as those of meshes are, always reported, and absurd ones with what to do."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nerfnav.importers.core.placement import Placement, warn_implausible_size
from nerfnav.importers.splats.formats import load_splats
from nerfnav.importers.splats.gaussians import Splats, robust_extent
from nerfnav.importers.splats.placement import guess_up, place_splats
from nerfnav.importers.splats.voxels import voxelize
from tests.importers.splat_files import Gaussians, write_inria


def splats_of(points: np.ndarray, folder: Path, opacity: float = 0.9) -> Splats:
    """Small round splats at points (n, 3)."""
    count = len(points)
    given = Gaussians(
        points, np.full((count, 3), 0.02), np.tile([1.0, 0, 0, 0], (count, 1)), np.full((count, 3), 0.5),
        np.full(count, opacity),
    )  # fmt: skip
    write_inria(folder / "a.ply", given)
    return load_splats(folder / "a.ply")


def room(count: int = 6000) -> np.ndarray:
    """A floor of 8 x 6 m and some things on it up to 2 m high, z up, around its middle."""
    rng = np.random.default_rng(0)
    floor = np.c_[rng.uniform(-4, 4, count), rng.uniform(-3, 3, count), np.zeros(count)]
    things = rng.uniform((-2, -2, 0), (1, 2, 2), (count // 2, 3))
    return np.concatenate([floor, things]) - np.array([0, 0, 0.7])


TURNS = {
    "-y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),  # z to -y
    "z": np.eye(3),
}


@pytest.mark.parametrize("up", TURNS)
def test_a_flat_place_is_stood_up_whether_its_file_has_y_down_or_z_up(up: str, tmp_path: Path) -> None:
    splats = splats_of(room() @ TURNS[up].T, tmp_path)
    direction, why = guess_up(splats)
    np.testing.assert_allclose(TURNS[up] @ [0, 0, 1], direction)
    assert ("flat and heavy below" in why) == (up == "z")


def test_a_thing_that_stands_on_the_origin_is_stood_upon_it(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    chair = rng.uniform((-0.3, 0, -0.3), (0.3, 1.1, 0.3), (4000, 3))
    assert guess_up(splats_of(chair, tmp_path))[0] == (0, 1, 0)
    assert guess_up(splats_of(chair * (1, -1, 1), tmp_path))[0] == (0, -1, 0)
    assert guess_up(splats_of(chair, tmp_path), (0.0, 1.0, 0.0)) == (
        (0, 1, 0), "(the habit of its format, and so it stands on the origin)"
    )  # fmt: skip


def test_what_is_reported_is_not_guessed(tmp_path: Path) -> None:
    splats = splats_of(room(), tmp_path)
    reported = place_splats(splats, Placement(up=(1.0, 0.0, 0.0), scale=0.5), tmp_path / "a.ply")
    assert (reported.up, reported.scale, reported.guesses) == ((1, 0, 0), 0.5, ())
    guessed = place_splats(splats, Placement(), tmp_path / "a.ply")
    assert guessed.scale == 1 and len(guessed.guesses) == 2
    assert "up is z" in guessed.guesses[0] and "nothing says how long a unit is" in guessed.guesses[1]


@pytest.mark.parametrize(
    ("meters", "said"), [(1218.0, "1.22 km long"), (300.0, "300 m long"), (0.04, "4 cm long"), (0.004, "4 mm long")]
)
def test_absurd_sizes_ask_to_measure_something(meters: float, said: str) -> None:
    doubt = warn_implausible_size(meters)
    assert doubt is not None and said in doubt and "measure something" in doubt


def test_plausible_sizes_raise_no_doubt() -> None:
    assert warn_implausible_size(0.6) is None and warn_implausible_size(60.0) is None


@pytest.mark.parametrize("size", [1.0, 40.0])
def test_the_box_holds_the_opacity_and_not_the_strays(size: float, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    place = size * room()
    haze = rng.normal(0, 15 * size, (2000, 3))  # a fifth of all splats, but hardly opaque
    far = rng.uniform(-60, 60, (90, 3)) * size  # a hundredth of the opacity
    splats = splats_of(np.concatenate([place, haze, far]), tmp_path)
    opacities = splats.opacities.copy()
    opacities[len(place) : -90] = 0.004
    splats = replace(splats, opacities=opacities)
    lower, upper = robust_extent(splats.centers, splats.masses)
    assert (lower <= place.min(0) + 0.02 * size).all() and (upper >= place.max(0) - 0.05 * size).all()
    assert (upper - lower < 1.5 * np.ptp(place, axis=0) + 0.5 * size).all()
    field = voxelize(splats)
    assert float(field.box.size.max()) < 13 * size


def test_a_mast_that_is_thin_but_there_stays_in_the_box(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    mast = np.c_[rng.normal(0, 0.05, (400, 2)), rng.uniform(0, 6, 400)]
    points = np.concatenate([room(), mast])
    lower, upper = robust_extent(splats_of(points, tmp_path).centers)
    assert upper[2] > 4.5 and lower[2] <= -0.69


def test_two_splats_that_lie_apart_along_all_axes_keep_the_habit_of_their_format() -> None:
    centers = np.array([[0.0, 0.0, -2.0], [-2.0, 2.0, 1.0]], np.float32)
    splats = Splats(
        centers, np.tile(1e-4 * np.eye(3, dtype=np.float32), (2, 1, 1)), np.full((2, 3), 0.5, np.float32),
        np.array([0.9, 0.6], np.float32), 2, {},
    )  # fmt: skip
    lower, upper = robust_extent(splats.centers, splats.masses)
    assert not ((splats.centers >= lower) & (splats.centers <= upper)).all(1).any()  # none lies in all three ranges
    assert guess_up(splats) == ((0, -1, 0), "(the habit of its format)")
