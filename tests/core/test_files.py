"""Files are whole or not there, and whatever goes wrong, the file that was there stays."""

import os
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

from nerfnav.core.files import replace_file, write_npz


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
