"""Splats in files: what was written is what is read, and what is no file of splats is told in one sentence."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nerfnav.errors import InvalidInputError
from nerfnav.importers.splats.layouts import holds_splats, load_splats
from nerfnav.importers.splats.splats import save_splats, splats_beside
from tests.importers.splat_files import Gaussians, some_splats, write_compressed, write_dot_splat, write_inria

Writer = Callable[[Path, Gaussians], None]
# how far steps of the layout move positions, covariances (relative), colours, opacities
LAYOUTS = {
    "a.splat": (write_dot_splat, 1e-6, 0.06, 0.003, 0.003),
    "a.ply": (write_inria, 1e-6, 1e-4, 1e-5, 1e-5),
    "a.compressed.ply": (write_compressed, 2e-3, 0.02, 0.003, 0.003),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_splats_come_back_as_they_were_written(name: str, tmp_path: Path) -> None:
    write, near, share, tint, opaque = LAYOUTS[name]
    given = some_splats(300)
    write(tmp_path / name, given)
    read = load_splats(tmp_path / name)
    assert len(read) == read.declared == 300 and not any(read.dropped.values())
    np.testing.assert_allclose(read.centers, given.centers, atol=near)
    np.testing.assert_allclose(read.rgbs, given.rgbs, atol=tint)
    np.testing.assert_allclose(read.opacities, given.opacities, atol=opaque)
    for index in range(0, 300, 7):
        wanted = given.covariance(index)
        assert np.abs(read.covariances[index] - wanted).max() < share * np.abs(wanted).max()
    assert holds_splats(tmp_path / name)


def test_what_is_not_finite_or_absurdly_large_is_dropped_and_counted(tmp_path: Path) -> None:
    given = some_splats(200)
    given.centers[3, 1] = np.nan
    given.wxyzs[9] = np.nan
    given.scales[5] = 30.0
    write_inria(tmp_path / "a.ply", given)
    read = load_splats(tmp_path / "a.ply")
    assert (read.declared, len(read)) == (200, 197)
    assert read.dropped == {"not finite": 2, "absurdly large": 1}


def test_own_files_bring_splats_back(tmp_path: Path) -> None:
    write_inria(tmp_path / "a.ply", some_splats(50))
    splats = load_splats(tmp_path / "a.ply")
    beside = splats_beside(tmp_path / "castle.npz")
    assert beside.name == "castle.splats.npz"
    again = load_splats(save_splats(splats, beside))
    np.testing.assert_array_equal(again.centers, splats.centers)
    np.testing.assert_array_equal(again.covariances, splats.covariances)
    np.testing.assert_allclose(again.rgbs, splats.rgbs, atol=0.002)


def test_placing_turns_covariances_with_centres(tmp_path: Path) -> None:
    write_inria(tmp_path / "a.ply", some_splats(20))
    splats = load_splats(tmp_path / "a.ply")
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    placed = splats.placed(turn, 2.0)
    np.testing.assert_allclose(placed.centers[:, 2], 2 * splats.centers[:, 1])
    np.testing.assert_allclose(placed.covariances[:, 2, 2], 4 * splats.covariances[:, 1, 1], rtol=1e-5)
    np.testing.assert_allclose(placed.covariances[:, 0, 1], 4 * splats.covariances[:, 2, 0], rtol=1e-5, atol=1e-9)


def _zero(path: Path) -> None:
    path.write_bytes(b"")


def _cut(write: Writer) -> Callable[[Path], None]:
    def broken(path: Path) -> None:
        write(path, some_splats(300))
        path.write_bytes(path.read_bytes()[:-50])

    return broken


def _text(path: Path) -> None:
    path.write_text("these are no splats at all, but a sentence of some length, and then some more words.\n" * 32)


def _too_many(path: Path) -> None:
    write_inria(path, some_splats(30), declared=40)


def _too_few(path: Path) -> None:
    write_inria(path, some_splats(30), declared=20)


def _mesh(path: Path) -> None:
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(header.encode() + bytes(12))


def _ascii(path: Path) -> None:
    path.write_text("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n")


def _strange_chunks(path: Path) -> None:
    write_compressed(path, some_splats(300))
    data = path.read_bytes().replace(b"element chunk 2", b"element chunk 1", 1)
    path.write_bytes(data[: data.index(b"end_header\n") + 11] + data[data.index(b"end_header\n") + 11 + 72 :])


@pytest.mark.parametrize(
    ("name", "make", "told"),
    [
        ("a.splat", _zero, "is empty"),
        ("a.ply", _zero, "is empty"),
        ("a.splat", _cut(write_dot_splat), "truncated"),
        ("a.ply", _cut(write_inria), "truncated"),
        ("a.ply", _cut(write_compressed), "truncated"),
        ("a.splat", _text, "no .splat file"),
        ("a.ply", _text, "not a PLY file"),
        ("a.ply", _too_many, "declares 40 rows .* but there are 30"),
        ("a.ply", _too_few, "more than its header declares"),
        ("a.ply", _mesh, "without splats: .* no f_dc_0"),
        ("a.ply", _ascii, "format ascii"),
        ("a.ply", _strange_chunks, "1 chunks for 300 splats, and 2 are needed"),
        ("a.txt", _text, "end in .ply or .splat"),
        ("a.splats.npz", _text, "not a whole file of splats"),
    ],
)
def test_files_that_are_no_whole_splats_are_refused(
    name: str, make: Callable[[Path], None], told: str, tmp_path: Path
) -> None:
    make(tmp_path / name)
    with pytest.raises(InvalidInputError, match=told):
        load_splats(tmp_path / name)


def test_a_file_of_nothing_usable_is_refused(tmp_path: Path) -> None:
    given = some_splats(5)
    write_inria(tmp_path / "a.ply", replace(given, centers=np.full((5, 3), np.nan)))
    with pytest.raises(InvalidInputError, match="no usable splat: of 5"):
        load_splats(tmp_path / "a.ply")
    with pytest.raises(InvalidInputError, match="there is no file"):
        load_splats(tmp_path / "nowhere.ply")


@pytest.mark.parametrize(
    ("name", "count"),
    [("plush.splat", 60634), ("inria_layout.ply", 9080), ("guitar.compressed.ply", 90854), ("three_points.ply", 3)],
)
@pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="NERFNAV_TEST_DATA does not say where files are")
def test_files_of_other_programs_hold_as_many_splats_as_they_say(name: str, count: int) -> None:
    file = Path(os.environ["NERFNAV_TEST_DATA"]) / "splats" / name
    splats = load_splats(file)
    assert splats.declared == count == len(splats) + sum(splats.dropped.values())
    assert holds_splats(file)
