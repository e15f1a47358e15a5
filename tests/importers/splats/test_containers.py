"""Splats of other layouts: discs, columns of colours, text, and folders and archives that hold them."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.kinds import SourceKind
from nerfnav.importers.detect import source_kind
from nerfnav.importers.splats.containers import splats_file
from nerfnav.importers.splats.formats import load_splats
from tests.importers.splat_files import (
    bundle_sog,
    some_splats,
    write_compressed,
    write_dot_splat,
    write_inria,
    write_ksplat,
    write_sog,
    write_spz,
)

COLUMNS = ("x", "y", "z", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3")
COLOURS = ("red", "green", "blue")


def write_table(path: Path, form: str, colour: str, count: int = 20, columns: tuple[str, ...] = COLUMNS) -> np.ndarray:
    """Write splats with red, green and blue of a type; all else is float. Returns the rows."""
    splats, order = some_splats(count), ">" if form == "binary_big_endian" else "<"
    kind = {"uchar": "u1", "ushort": "u2", "float": "f4"}[colour]
    rows = np.zeros(count, [(name, f"{order}f4") for name in columns] + [(name, order + kind) for name in COLOURS])
    rows["x"], rows["y"], rows["z"] = splats.centers.T
    rows["opacity"] = 1.0
    for index, name in enumerate(name for name in columns if name.startswith("scale")):
        rows[name] = np.log(splats.scales[:, index])
    for index in range(4):
        rows[f"rot_{index}"] = splats.wxyzs[:, index]
    for index, name in enumerate(COLOURS):
        rows[name] = splats.rgbs[:, index] * (1 if kind == "f4" else np.iinfo(kind).max)
    header = f"ply\nformat {form} 1.0\nelement vertex {count}\n"
    header += "".join(f"property float {name}\n" for name in columns)
    header += "".join(f"property {colour} {name}\n" for name in COLOURS) + "end_header\n"
    text = "".join(" ".join(f"{number:.9g}" for number in row) + "\n" for row in rows.tolist()).encode()
    path.write_bytes(header.encode() + (text if form == "ascii" else rows.tobytes()))
    return rows


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian", "ascii"])
@pytest.mark.parametrize("colour", ["uchar", "ushort", "float"])
def test_columns_of_red_green_and_blue_are_colours(form: str, colour: str, tmp_path: Path) -> None:
    write_table(tmp_path / "a.ply", form, colour)
    assert source_kind(tmp_path / "a.ply") is SourceKind.SPLATS
    read, given = load_splats(tmp_path / "a.ply"), some_splats(20)
    np.testing.assert_allclose(read.rgbs, given.rgbs, atol=1 / 255)
    np.testing.assert_allclose(read.centers, given.centers, rtol=1e-6)


@pytest.mark.parametrize("count", [1, 20])
def test_discs_of_two_scales_are_flat(count: int, tmp_path: Path) -> None:
    columns = tuple(name for name in COLUMNS if name != "scale_2")
    write_table(tmp_path / "a.ply", "binary_little_endian", "uchar", count, columns)
    read, given = load_splats(tmp_path / "a.ply"), some_splats(count)
    squares = np.linalg.eigvalsh(read.covariances.astype(np.float64))
    assert len(read) == count and (squares[:, 0] < 1e-5 * squares[:, 2]).all()
    np.testing.assert_allclose(squares[:, 1:], np.sort(given.scales[:, :2] ** 2), rtol=1e-3)


def test_text_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    write_table(tmp_path / "a.ply", "ascii", "uchar")
    (tmp_path / "a.ply").write_bytes((tmp_path / "a.ply").read_bytes()[:-200])
    with pytest.raises(InvalidInputError, match=r"a\.ply"):
        load_splats(tmp_path / "a.ply")


def test_without_any_colour_a_file_holds_no_splats(tmp_path: Path) -> None:
    write_table(tmp_path / "a.ply", "ascii", "uchar")
    (tmp_path / "a.ply").write_bytes((tmp_path / "a.ply").read_bytes().replace(b"uchar green", b"uchar gray"))
    assert source_kind(tmp_path / "a.ply") is SourceKind.MESH
    with pytest.raises(InvalidInputError, match=r"no f_dc_0, f_dc_1, f_dc_2$"):
        load_splats(tmp_path / "a.ply")


def trained(folder: Path) -> Path:
    """What training of splats leaves behind."""
    for iteration in (7000, 30000):
        place = folder / "point_cloud" / f"iteration_{iteration}"
        place.mkdir(parents=True)
        write_inria(place / "point_cloud.ply", some_splats(iteration // 1000))
    (folder / "cameras.json").write_text(json.dumps([{"id": 0, "img_name": "0001", "width": 4, "height": 4}]))
    (folder / "cfg_args").write_text("Namespace(sh_degree=3)")
    (folder / "input.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n")
    return folder


def zipped(folder: Path, archive: Path, separator: str = "/") -> Path:
    with zipfile.ZipFile(archive, "w") as content:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                content.writestr(str(path.relative_to(folder)).replace("/", separator), path.read_bytes())
    return archive


def test_the_last_iteration_of_a_training_counts(tmp_path: Path) -> None:
    folder = trained(tmp_path / "model")
    for source in (folder, folder / "point_cloud", folder / "point_cloud" / "iteration_30000"):
        assert source_kind(source) is SourceKind.SPLATS and len(load_splats(source)) == 30
    archive = zipped(folder, tmp_path / "model.zip")
    assert source_kind(archive) is SourceKind.SPLATS and len(load_splats(archive)) == 30


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.ply", write_inria),
        ("a.compressed.ply", write_compressed),
        ("a.splat", write_dot_splat),
        ("a.spz", write_spz),
        ("a.sog", bundle_sog),
        ("a.ksplat", write_ksplat),
    ],
)
def test_an_archive_may_hold_splats_of_any_ending(name: str, write: Callable, tmp_path: Path) -> None:
    (tmp_path / "in" / "deep").mkdir(parents=True)
    write(tmp_path / name, some_splats(40))
    (tmp_path / name).rename(tmp_path / "in" / "deep" / name)
    (tmp_path / "in" / "._a.ply").write_bytes(b"\0\5\x16\7")
    archive = zipped(tmp_path / "in", tmp_path / "scan.zip")
    assert source_kind(archive) is SourceKind.SPLATS and len(load_splats(archive)) == 40
    assert splats_file(archive).suffix == Path(name).suffix  # says which way is up


def test_an_archive_may_hold_the_parts_of_a_sog(tmp_path: Path) -> None:
    write_sog(tmp_path / "parts", some_splats(40))
    assert len(load_splats(zipped(tmp_path / "parts", tmp_path / "scan.zip"))) == 40


def test_several_splats_are_listed_and_refused(tmp_path: Path) -> None:
    folder = tmp_path / "two"
    folder.mkdir()
    for name in ("a.ply", "b.ply"):
        write_inria(folder / name, some_splats(9))
    for source in (folder, zipped(folder, tmp_path / "two.zip")):
        assert source_kind(source) is SourceKind.SPLATS
        with pytest.raises(InvalidInputError, match=r"holds 2 files of splats \(a.ply, b.ply\)"):
            load_splats(source)


def test_damage_in_an_archive_names_the_archive(tmp_path: Path) -> None:
    write_inria(tmp_path / "a.ply", some_splats(9))
    with zipfile.ZipFile(tmp_path / "scan.zip", "w") as content:
        content.writestr("a.ply", (tmp_path / "a.ply").read_bytes()[:-9])
    with pytest.raises(InvalidInputError, match=r"scan\.zip: a\.ply is truncated"):
        load_splats(tmp_path / "scan.zip")


def test_a_capture_with_splats_stays_a_capture(tmp_path: Path) -> None:
    folder = tmp_path / "scan"
    folder.mkdir()
    write_inria(folder / "a.ply", some_splats(9))
    (folder / "transforms.json").write_text('{"frames": []}')
    assert source_kind(folder) is SourceKind.CAPTURE
    assert source_kind(zipped(folder, tmp_path / "scan.zip")) is SourceKind.CAPTURE
