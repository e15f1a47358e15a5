"""Files are whole or not there, and whatever goes wrong, the file that was there stays."""

import os
import pickle
import zipfile
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

from nerfnav.core.files import DamagedNpzError, open_npz, replace_file, write_npz


def fails(*_: object, **__: object) -> NoReturn:
    raise OSError(28, "No space left on device")


def test_a_file_is_not_seen_before_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "file"
    with replace_file(path) as stream:
        stream.write(b"half")
        stream.flush()
        assert not path.exists()
    assert path.read_bytes() == b"half"
    assert list(tmp_path.iterdir()) == [path]


def test_an_older_file_is_replaced_by_a_shorter_one(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"older and longer")
    with replace_file(path) as stream:
        stream.write(b"new")
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), GeneratorExit()])
def test_whatever_ends_the_writing_the_older_file_stays_alone(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    with pytest.raises(type(error)), replace_file(path) as stream:
        stream.write(b"new")
        raise error
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_disk_that_is_full_only_when_it_counts_leaves_the_older_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    monkeypatch.setattr({"fsync": os, "replace": Path}[step], step, fails)
    with pytest.raises(OSError, match="No space left"), replace_file(path) as stream:
        stream.write(b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["missing/file", "taken/file"])
def test_a_place_that_takes_no_files_is_told_as_it_is(tmp_path: Path, name: str) -> None:
    (tmp_path / "taken").touch()
    with pytest.raises((FileNotFoundError, NotADirectoryError)), replace_file(tmp_path / name):
        pytest.fail("nothing is written to nowhere")


def test_named_arrays_come_back_without_pickle(tmp_path: Path) -> None:
    arrays = {"header": np.array("text"), "table": np.arange(6).reshape(2, 3)}
    size = write_npz(tmp_path / "arrays.npz", arrays)
    assert size == (tmp_path / "arrays.npz").stat().st_size
    with np.load(tmp_path / "arrays.npz", allow_pickle=False) as stored:
        assert {name: stored[name].tolist() for name in stored} == {name: a.tolist() for name, a in arrays.items()}


def test_arrays_that_do_not_fit_the_disk_leave_the_older_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "arrays.npz"
    path.write_bytes(b"old")
    monkeypatch.setattr(np, "savez_compressed", fails)
    with pytest.raises(OSError, match="No space left"):
        write_npz(path, {"one": np.zeros(3)})
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def stored(path: Path, **arrays: np.ndarray) -> Path:
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type]
    return path


def changed(path: Path, name: str, content: bytes) -> Path:
    """Replace a member of an archive, which stays whole."""
    with zipfile.ZipFile(path) as archive:
        members = {member: archive.read(member) for member in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for member, data in (members | {name: content}).items():
            archive.writestr(member, data)
    return path


def test_arrays_and_header_are_read_by_name(tmp_path: Path) -> None:
    path = stored(tmp_path / "a.npz", header=np.array('{"format": "x"}'), values=np.arange(3))
    with open_npz(path) as file:
        assert file.header == {"format": "x"} and list(file) == ["header", "values"] and len(file) == 2
        assert file["values"].tolist() == [0, 1, 2] and "other" not in file and file.size > 24
        with pytest.raises(DamagedNpzError, match="it has no array 'other'"):
            file["other"]


@pytest.mark.parametrize(
    "content",
    [b"", b"\x93NUMPY", b"\x93NUMPY\x01\0\x10\0{'descr': '<f4'}   ", b"not an array", pickle.dumps({"a": 1})],
)
def test_an_array_that_cannot_be_read_is_named(content: bytes, tmp_path: Path) -> None:
    path = changed(stored(tmp_path / "a.npz", values=np.arange(3)), "values.npy", content)
    with open_npz(path) as file, pytest.raises(DamagedNpzError, match="'values'"):
        file["values"]


def test_every_flipped_bit_gives_the_same_array_or_the_one_error(tmp_path: Path) -> None:
    values = np.arange(40)
    whole = stored(tmp_path / "a.npz", values=values).read_bytes()
    refused = 0
    for at in range(len(whole)):
        (tmp_path / "b.npz").write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1 :])
        try:
            with open_npz(tmp_path / "b.npz") as file:
                assert np.array_equal(file["values"], values)
        except DamagedNpzError:
            refused += 1
    assert refused > len(whole) // 2


def test_text_of_no_characters_is_damage(tmp_path: Path) -> None:
    words = np.array('{"a": "b"}')
    words.reshape(1).view(np.uint32)[3] = 15212333
    with open_npz(stored(tmp_path / "a.npz", header=words)) as file, pytest.raises(DamagedNpzError, match="text"):
        file.header  # noqa: B018


@pytest.mark.parametrize("header", [np.array("{"), np.array("[1]"), np.array(3), np.zeros((2, 2)), np.array("NaN")])
def test_a_header_that_is_no_object_is_refused(header: np.ndarray, tmp_path: Path) -> None:
    with open_npz(stored(tmp_path / "a.npz", header=header)) as file, pytest.raises(DamagedNpzError, match="header"):
        file.header  # noqa: B018


def test_one_array_alone_is_no_npz(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.arange(3))
    with pytest.raises(DamagedNpzError, match="one array"), open_npz(tmp_path / "a.npy"):
        pass
