"""Splats in files: what was written is what is read, and what is no file of splats is reported in one sentence."""

import gzip
import os
import struct
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.splats.formats import holds_splats, load_splats
from nerfnav.importers.splats.gaussians import fit_half_precision, save_splats, splats_path
from tests.importers.splat_files import (
    Gaussians,
    bundle_sog,
    some_splats,
    write_compressed,
    write_dot_splat,
    write_inria,
    write_ksplat,
    write_sog,
    write_spz,
)

Writer = Callable[[Path, Gaussians], None]
# how far steps of the layout move positions, covariances (relative), colours, opacities
LAYOUTS = {
    "a.splat": (write_dot_splat, 1e-6, 0.06, 0.003, 0.003),
    "a.ply": (write_inria, 1e-6, 1e-4, 1e-5, 1e-5),
    "a.compressed.ply": (write_compressed, 2e-3, 0.02, 0.003, 0.003),
    "a.spz": (write_spz, 2e-4, 0.1, 0.02, 0.003),
    "two.spz": (partial(write_spz, version=2, bits=18), 3e-6, 0.15, 0.02, 0.003),
    "four.spz": (partial(write_spz, version=4), 2e-4, 0.1, 0.02, 0.003),
    "a_sog": (write_sog, 5e-5, 0.06, 0.003, 0.003),
    "a.sog": (bundle_sog, 5e-5, 0.06, 0.003, 0.003),
    "a.ksplat": (write_ksplat, 5e-5, 0.005, 0.003, 0.003),
    "zero.ksplat": (partial(write_ksplat, level=0, degree=2), 1e-6, 1e-4, 0.003, 0.003),
    "two.ksplat": (partial(write_ksplat, level=2, degree=0), 5e-5, 0.005, 0.003, 0.003),
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
    beside = splats_path(tmp_path / "castle.npz")
    assert beside.name == "castle.splats.npz"
    again = load_splats(save_splats(splats, beside))
    np.testing.assert_array_equal(again.centers, splats.centers)
    np.testing.assert_array_equal(again.covariances, splats.covariances)
    np.testing.assert_allclose(again.rgbs, splats.rgbs, atol=0.002)


def test_placing_turns_covariances_with_centres(tmp_path: Path) -> None:
    write_inria(tmp_path / "a.ply", some_splats(20))
    splats = load_splats(tmp_path / "a.ply")
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    placed = splats.to_world(turn, 2.0)
    np.testing.assert_allclose(placed.centers[:, 2], 2 * splats.centers[:, 1])
    np.testing.assert_allclose(placed.covariances[:, 2, 2], 4 * splats.covariances[:, 1, 1], rtol=1e-5)
    np.testing.assert_allclose(placed.covariances[:, 0, 1], 4 * splats.covariances[:, 2, 0], rtol=1e-5, atol=1e-9)


def _zero(path: Path) -> None:
    path.write_bytes(b"")


def _cut(write: Writer, missing: int = 50) -> Callable[[Path], None]:
    def broken(path: Path) -> None:
        write(path, some_splats(300))
        path.write_bytes(path.read_bytes()[:-missing])

    return broken


def _another(write: Writer) -> Callable[[Path], None]:
    """A file of another layout than its ending says."""
    return lambda path: write(path, some_splats(300))


def write_sog_plane(path: Path, splats: Gaussians) -> None:
    """One of the pictures that a SOG is made of."""
    write_sog(path.with_name("parts"), splats)
    path.write_bytes((path.with_name("parts") / "quats.webp").read_bytes())


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


def _without(column: bytes) -> Callable[[Path], None]:
    """Writes compressed splats whose header names one column of the chunks otherwise."""

    def write(path: Path) -> None:
        write_compressed(path, some_splats(30))
        path.write_bytes(path.read_bytes().replace(b" " + column + b"\n", b" other\n", 1))

    return write


def _strange_chunks(path: Path) -> None:
    write_compressed(path, some_splats(300))
    data = path.read_bytes().replace(b"element chunk 2", b"element chunk 1", 1)
    path.write_bytes(data[: data.index(b"end_header\n") + 11] + data[data.index(b"end_header\n") + 11 + 72 :])


@pytest.mark.parametrize(
    ("name", "make", "reported"),
    [
        ("a.splat", _zero, "is empty"),
        ("a.ply", _zero, "is empty"),
        ("a.splat", _cut(write_dot_splat), "truncated"),
        ("a.ply", _cut(write_inria), "truncated"),
        ("a.ply", _cut(write_compressed), "truncated"),
        *[("a.ply", _without(name), f"has no {name.decode()}") for name in (b"min_r", b"min_g", b"max_b", b"max_x")],
        ("a.splat", _text, "no .splat file"),
        ("a.ply", _text, "not a PLY file"),
        ("a.ply", _too_many, "declares 40 rows .* but there are 30"),
        ("a.ply", _too_few, "more than its header declares"),
        ("a.ply", _mesh, "without splats: .* no f_dc_0"),
        ("a.ply", _ascii, "format ascii"),
        ("a.ply", _strange_chunks, "1 chunks for 300 splats, and 2 are needed"),
        ("a.txt", _text, "end in .ply, .splat, .spz"),
        ("a.splats.npz", _text, "not a whole file of splats"),
        ("a.spz", _cut(write_spz), "truncated|damaged"),
        ("a.spz", _cut(partial(write_spz, version=4)), "truncated: it ends in stream"),
        ("a.spz", _cut(partial(write_spz, version=4), 4900), "truncated"),
        ("a.spz", partial(write_spz, splats=some_splats(3), version=9), "version 9 of SPZ; versions 2 to 4"),
        ("a.spz", _another(write_inria), "is no .spz file of splats: it is a PLY file"),
        ("a.spz", _another(bundle_sog), "is no .spz file of splats: it is a zip archive"),
        ("a.sog", _cut(bundle_sog), "truncated: it is a zip archive whose end is missing"),
        ("a.sog", _another(write_spz), "is no .sog file of splats: it is gzip data"),
        ("a.sog", _text, "is no .sog file of splats: it is text"),
        ("a.ksplat", _cut(write_ksplat), "truncated: section 2 of 2 ends"),
        ("a.ksplat", _cut(write_ksplat, 9000), "truncated"),
        ("a.ksplat", _another(write_sog_plane), "is no .ksplat file of splats: it is a WebP picture"),
        ("a.ksplat", _another(write_dot_splat), "is no .ksplat file"),
    ],
)
def test_files_that_are_no_whole_splats_are_refused(
    name: str, make: Callable[[Path], None], reported: str, tmp_path: Path
) -> None:
    make(tmp_path / name)
    with pytest.raises(InvalidInputError, match=reported):
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
    [
        ("plush.splat", 60634),
        ("inria_layout.ply", 9080),
        ("guitar.compressed.ply", 90854),
        ("three_points.ply", 3),
        ("biker.spz", 152746),
        ("playbot_sog", 125000),
        ("playbot_sog/meta.json", 125000),
    ],
)
@pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="NERFNAV_TEST_DATA does not say where files are")
def test_files_of_other_programs_hold_as_many_splats_as_they_say(name: str, count: int) -> None:
    file = Path(os.environ["NERFNAV_TEST_DATA"]) / "splats" / name
    splats = load_splats(file)
    assert splats.declared == count == len(splats) + sum(splats.dropped.values())
    assert holds_splats(file)


def test_a_sog_that_lacks_a_picture_or_has_a_broken_one_is_refused(tmp_path: Path) -> None:
    write_sog(tmp_path, some_splats(300))
    quats = tmp_path / "quats.webp"
    whole = quats.read_bytes()
    quats.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InvalidInputError, match=r"quats.webp is truncated or no picture"):
        load_splats(tmp_path)
    quats.unlink()
    with pytest.raises(InvalidInputError, match=r"needs quats.webp, which cannot be read"):
        load_splats(tmp_path)
    (tmp_path / "meta.json").write_text((tmp_path / "meta.json").read_text().replace("quats.webp", "../quats.webp"))
    with pytest.raises(InvalidInputError, match="outside its own folder"):
        load_splats(tmp_path / "meta.json")
    (tmp_path / "meta.json").write_text('{"scenes": []}')
    assert not holds_splats(tmp_path) and not holds_splats(tmp_path / "meta.json")


def test_gzip_data_that_swells_without_end_is_not_unpacked_beyond_its_splats(tmp_path: Path) -> None:
    write_spz(tmp_path / "a.spz", some_splats(5))
    swollen = gzip.compress(gzip.decompress((tmp_path / "a.spz").read_bytes()) + bytes(50_000_000))
    (tmp_path / "a.spz").write_bytes(swollen)
    tracemalloc.start()
    assert len(load_splats(tmp_path / "a.spz")) == 5


def test_no_memory_is_taken_for_what_a_stream_says_of_itself(tmp_path: Path) -> None:
    path = tmp_path / "a.spz"
    write_spz(path, some_splats(5), version=4)
    data = bytearray(path.read_bytes())
    (table,) = struct.unpack_from("<I", data, 16)  # see spz.py
    streams = data[15]
    at = table + 16 * streams
    # one frame of Zstandard that says that it holds 2^50 bytes, and holds none
    huge = bytes.fromhex("28b52ffd e0") + (1 << 50).to_bytes(8, "little") + bytes.fromhex("010000")
    stored, unpacked = struct.unpack_from("<QQ", data, table)
    struct.pack_into("<QQ", data, table, len(huge), unpacked)
    path.write_bytes(bytes(data[:at]) + huge + bytes(data[at + stored :]))
    with pytest.raises(InvalidInputError, match="stream 1 has another size than its splats take"):
        load_splats(path)
    assert tracemalloc.get_traced_memory()[1] < 5_000_000
    tracemalloc.stop()


def test_covariances_have_no_negative_eigenvalues_even_after_storing(tmp_path: Path) -> None:
    flat = some_splats(400)
    flat.scales[:] = (0.3, 0.2, 1e-6)
    write_inria(tmp_path / "a.ply", flat)
    read = load_splats(tmp_path / "a.ply")
    turned = read.to_world(np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0], 7.0)
    stored = load_splats(save_splats(turned, tmp_path / "a.splats.npz"))
    for splats in (read, turned, stored):
        assert np.linalg.eigvalsh(splats.covariances.astype(np.float64)).min() > 0
    older = replace(read, covariances=read.covariances - 1e-4 * np.eye(3, dtype=np.float32))  # of an older nerfnav
    again = load_splats(save_splats(older, tmp_path / "older.splats.npz"))
    assert np.linalg.eigvalsh(again.covariances.astype(np.float64)).min() > 0
    np.testing.assert_allclose(again.covariances, read.covariances, atol=2e-4)


@pytest.mark.parametrize("size", [1e-4, 1.0, 1000.0])
def test_browsers_get_covariances_that_half_precision_can_hold(size: float, tmp_path: Path) -> None:
    flat = some_splats(300)
    flat.centers[:] *= 20 * max(size, 1.0)
    flat.scales[:] = (size, 0.3 * size, 1e-5 * size)
    write_inria(tmp_path / "a.ply", flat)
    read = load_splats(tmp_path / "a.ply")
    assert len(read) == 300
    sent = fit_half_precision(read.covariances).astype(np.float16).astype(np.float64)
    assert np.isfinite(sent).all() and np.linalg.eigvalsh(sent).min() >= 0
    if size == 1.0:
        assert np.abs(sent - read.covariances).max() < 0.003
