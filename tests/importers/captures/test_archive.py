"""Captures that come as one file from anybody."""

import contextlib
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from nerfnav.importers.captures import archive
from nerfnav.importers.captures.archive import unpack_capture
from nerfnav.importers.captures.formats import read_views
from nerfnav.importers.captures.views import CaptureError
from tests.importers.captures.synthetic import changed, write_colmap, write_transforms


def zipped(folder: Path, path: Path, under: str = "") -> Path:
    with zipfile.ZipFile(path, "w") as content:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                content.write(file, f"{under}{file.relative_to(folder)}")
    return path


@pytest.mark.parametrize("under", ["", "my capture/", "a/b/"])
def test_a_capture_is_found_wherever_in_the_archive_it_lies(tmp_path: Path, under: str) -> None:
    path = zipped(write_transforms(tmp_path / "in"), tmp_path / "c.zip", under)
    found = read_views(unpack_capture(path, tmp_path / "out"))
    assert len(found.views) == 8 and all(view.exists for view in found.views)


def test_a_colmap_model_comes_out_whole(tmp_path: Path) -> None:
    path = zipped(write_colmap(tmp_path / "in", binary=True), tmp_path / "c.zip")
    assert read_views(unpack_capture(path, tmp_path / "out")).kind == "COLMAP"


@pytest.mark.parametrize(
    "name", ["../evil.json", "/etc/evil.json", "a/../../evil.json", "C:\\evil.json", "..\\evil.txt"]
)
def test_files_that_lead_out_of_the_folder_are_refused_and_nothing_is_written(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(tmp_path / "c.zip", "w") as content:
        content.writestr("transforms.json", "{}")
        content.writestr(name, "x")
    (tmp_path / "out").mkdir()
    with pytest.raises(CaptureError, match="outside of its own folder"):
        unpack_capture(tmp_path / "c.zip", tmp_path / "out")
    assert sorted(tmp_path.rglob("*")) == [tmp_path / "c.zip", tmp_path / "out"]


def test_an_archive_that_swells_beyond_measure_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "c.zip", "w", zipfile.ZIP_DEFLATED) as content:
        content.writestr("transforms.json", b" " * (200 << 20))
    with pytest.raises(CaptureError, match="would swell to 200 MB"):
        unpack_capture(tmp_path / "c.zip", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("name", "value"), [("MOST_FILES", 3), ("MOST_BYTES", 1000)])
def test_archives_of_too_much_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, value: int
) -> None:
    path = zipped(write_transforms(tmp_path / "in"), tmp_path / "c.zip")
    monkeypatch.setattr(archive, name, value)
    with pytest.raises(CaptureError, match=r"holds 9 files .* at most"):
        unpack_capture(path, tmp_path / "out")


def test_a_size_that_the_archive_lies_about_is_not_exceeded(tmp_path: Path) -> None:
    path = tmp_path / "c.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as content:
        content.writestr("transforms.json", b" " * (1 << 20))
    true = (1 << 20).to_bytes(4, "little")
    path.write_bytes(path.read_bytes().replace(true, (100).to_bytes(4, "little")))
    with pytest.raises(CaptureError, match=r"no readable \.zip"):
        unpack_capture(path, tmp_path / "out")
    assert sum(file.stat().st_size for file in (tmp_path / "out").rglob("*") if file.is_file()) <= 100


@pytest.mark.parametrize("share", [0.0, 0.5, 0.95])
def test_what_is_no_whole_archive_is_refused(tmp_path: Path, share: float) -> None:
    path = zipped(write_transforms(tmp_path / "in"), tmp_path / "c.zip")
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(CaptureError, match=r"no readable \.zip"):
        unpack_capture(path, tmp_path / "out")
    path.write_text("a letter")
    with pytest.raises(CaptureError, match=r"no readable \.zip"):
        unpack_capture(path, tmp_path / "out")


def test_an_archive_without_a_capture_says_what_was_looked_for(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "c.zip", "w") as content:
        content.writestr("notes.txt", "x")
        content.writestr("program.exe", "x")
    with pytest.raises(CaptureError, match=r"no transforms\.json"):
        unpack_capture(tmp_path / "c.zip", tmp_path / "out")
    assert not (tmp_path / "out" / "program.exe").exists()


def test_whatever_breaks_in_a_file_is_reported_as_a_broken_capture(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    write_colmap(tmp_path / "in", binary=True)
    with zipfile.ZipFile(tmp_path / "c.zip", "w", zipfile.ZIP_DEFLATED) as content:
        for file in (tmp_path / "in" / "sparse" / "0").iterdir():
            content.write(file, f"sparse/0/{file.name}")
    whole = np.frombuffer((tmp_path / "c.zip").read_bytes(), np.uint8)
    refused = 0
    for index in range(150):
        broken = whole.copy()
        broken[rng.integers(0, len(whole), 3)] = rng.integers(0, 256, 3)
        (tmp_path / "c.zip").write_bytes(broken.tobytes())
        try:
            read_views(unpack_capture(tmp_path / "c.zip", tmp_path / str(index)))
        except CaptureError:
            refused += 1
    assert refused > 75


def test_whatever_breaks_in_a_binary_model_is_reported_as_a_broken_capture(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    folder = write_colmap(tmp_path, binary=True)
    for name in ("cameras.bin", "images.bin"):
        path = folder / "sparse" / "0" / name
        whole = np.frombuffer(path.read_bytes(), np.uint8)
        for _ in range(150):
            broken = whole.copy()
            broken[rng.integers(0, len(whole), 3)] = rng.integers(0, 256, 3)
            path.write_bytes(broken.tobytes())
            with contextlib.suppress(CaptureError):
                read_views(folder)
        path.write_bytes(whole.tobytes())
    assert len(read_views(folder).views) == 8


def test_archives_of_other_systems_are_read(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path / "in")
    path = tmp_path / "c.zip"
    with zipfile.ZipFile(path, "w") as content:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                name = str(file.relative_to(folder)).replace("/", "\\")
                content.write(file, f"cap\\{name}")
                content.writestr(f"__MACOSX/cap/._{file.name}", b"\x00\x05\x16\x07")
                content.writestr(f"cap/{file.parent.name}/._{file.name}", b"\x00\x05\x16\x07")
    out = tmp_path / "out"
    found = read_views(unpack_capture(path, out))
    assert len(found.views) == 8 and all(view.exists for view in found.views)
    assert not [entry for entry in out.rglob("*") if entry.name.startswith(("._", "__"))]


@pytest.mark.parametrize("ending", [".bmp", ".TIF", ".tiff", ".JPEG", ".webp"])
def test_pictures_of_every_kind_are_unpacked(tmp_path: Path, ending: str) -> None:
    folder = write_transforms(tmp_path / "in")
    for picture in sorted((folder / "images").iterdir()):
        Image.open(picture).save(picture.with_suffix(ending))
        picture.unlink()
    changed(folder, lambda said: [frame.update(file_path=frame["file_path"][:-4]) for frame in said["frames"]])
    found = read_views(unpack_capture(zipped(folder, tmp_path / "c.zip"), tmp_path / "out"))
    assert all(view.exists for view in found.views)
