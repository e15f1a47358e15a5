"""Names of files that other systems wrote."""

from pathlib import Path

import pytest

from nerfnav.formats.files import PICTURES, NamedFiles, is_system_file, list_folder


@pytest.mark.parametrize("name", ["images\\0.Jpg", "./images/0.Jpg", "images/0", "IMAGES/0.JPG", "Images\\0"])
def test_a_name_is_found_in_any_spelling(tmp_path: Path, name: str) -> None:
    (tmp_path / "images").mkdir()
    (tmp_path / "images" / "0.Jpg").touch()
    (tmp_path / "images" / "._0.Jpg").touch()
    assert NamedFiles(tmp_path).find(name) == tmp_path / "images" / "0.Jpg"


@pytest.mark.parametrize("ending", PICTURES)
def test_every_ending_of_pictures_may_be_missing(tmp_path: Path, ending: str) -> None:
    for name in (f"lower{ending}", f"upper{ending.upper()}"):
        (tmp_path / name).touch()
        assert NamedFiles(tmp_path).find(name.partition(".")[0]) == tmp_path / name


def test_a_name_with_a_backslash_that_exists_is_itself(tmp_path: Path) -> None:
    (tmp_path / "a\\b.png").touch()
    assert NamedFiles(tmp_path).find("a\\b.png") == tmp_path / "a\\b.png"


@pytest.mark.parametrize("name", ["nothing", "no/thing.png", "no\\thing.png", "a\0", ".", 300 * "x"])
def test_what_is_not_there_is_as_named(tmp_path: Path, name: str) -> None:
    assert NamedFiles(tmp_path).find(name) == tmp_path / name.replace("\\", "/")


def test_files_of_file_systems_are_no_data(tmp_path: Path) -> None:
    for name in ("._0.json", ".DS_Store", "Thumbs.db", "0.json"):
        (tmp_path / name).touch()
    assert list_folder(tmp_path) == [tmp_path / "0.json"]
    assert is_system_file("__MACOSX/a/0.json") and not is_system_file("a/0.json")


@pytest.mark.parametrize("name", ["/home/x/images/a/0.png", "C:\\set\\images\\a\\0", "../set/a/0.png", "a/0.JPG.png"])
@pytest.mark.parametrize("folder", ["", "images", "images_4", "input"])
def test_pictures_that_were_moved_are_found(tmp_path: Path, name: str, folder: str) -> None:
    path = tmp_path / folder / "a" / ("0.JPG.png" if "JPG" in name else "0.png")
    path.parent.mkdir(parents=True)
    path.touch()
    assert NamedFiles(tmp_path).find_picture(name) == path


def test_a_picture_that_was_moved_stands_for_one_name(tmp_path: Path) -> None:
    (tmp_path / "0.png").touch()
    files = NamedFiles(tmp_path)
    assert files.find_picture("left/0.png") == files.find_picture("left/0.png") == tmp_path / "0.png"
    assert files.find_picture("right/0.png") == tmp_path / "right" / "0.png"
