"""Files are written whole or not at all, where they can be written."""

import json
from pathlib import Path

import pytest

from nerfnav_app.storage.output_files import OutputError, json_line, prepare_file, prepare_folder, write_text


def test_missing_folders_are_made(tmp_path: Path) -> None:
    assert prepare_folder(tmp_path / "a" / "b").is_dir()
    assert prepare_file(tmp_path / "c" / "d.txt").parent.is_dir()
    assert list((tmp_path / "a" / "b").iterdir()) == [], "the trial file is gone"


def test_a_folder_below_a_file_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot write into the folder"):
        prepare_folder(tmp_path / "file" / "below")


def test_a_file_system_that_takes_no_files_is_noticed() -> None:
    with pytest.raises(OutputError, match="cannot write into the folder /proc"):
        prepare_folder(Path("/proc/self"))


def test_a_file_is_replaced_in_one_piece(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    path.write_text("old")
    assert write_text(path, "new").read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_cannot_be_written_is_told_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot write the file"):
        write_text(tmp_path / "missing" / "file.txt", "text")
    assert list(tmp_path.iterdir()) == []


def test_json_lines_are_strict() -> None:
    assert json.loads(json_line({"a": float("nan"), "b": (1, 2.5)})) == {"a": None, "b": [1, 2.5]}
