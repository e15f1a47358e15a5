"""The library of places: what was brought, and what was made of it."""

from pathlib import Path

import pytest

from nerfnav.core.errors import UnknownNameError
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.places.uploads import NameRefusedError, UploadError


def brought(library: PlaceLibrary, name: str = "moon.splat", content: bytes = b"splats") -> Path:
    """A file that was brought, and opened."""
    source = library.keep(name, content)
    field = source.with_suffix(".npz")
    field.write_bytes(b"a field")
    library.opened(source, field, b"a picture")
    return source


def test_what_was_opened_is_there_again_with_all_that_is_known_of_it(tmp_path: Path) -> None:
    source = brought(PlaceLibrary(tmp_path))
    (place,) = PlaceLibrary(tmp_path).entries()
    assert (place.name, place.source, place.what) == ("moon", "moon.splat", str(source))
    assert place.field_file.read_bytes() == b"a field" and place.picture_file.read_bytes() == b"a picture"
    assert place.size_bytes > 20 and place.date.startswith("20")


def test_the_same_upload_finds_its_place_whatever_it_is_called(tmp_path: Path) -> None:
    first = brought(PlaceLibrary(tmp_path))
    assert PlaceLibrary(tmp_path).keep("other.splat", b"splats") == first
    assert PlaceLibrary(tmp_path).keep("moon.splat", b"others") != first


def test_what_never_opened_is_in_no_list_and_gone_at_the_end(tmp_path: Path) -> None:
    library = PlaceLibrary(tmp_path)
    torn, whole = library.keep("torn.glb", b"torn"), brought(library)
    assert [place.what for place in library.entries()] == [str(whole)]
    library.close()
    assert not torn.exists() and whole.is_file()


def test_a_place_whose_field_is_gone_is_not_listed(tmp_path: Path) -> None:
    source = brought(PlaceLibrary(tmp_path))
    source.with_suffix(".npz").unlink()
    assert PlaceLibrary(tmp_path).entries() == ()


def test_places_are_renamed_and_deleted(tmp_path: Path) -> None:
    library = PlaceLibrary(tmp_path)
    source = brought(library)
    (place,) = library.entries()
    library.rename(place.key, "The moon")
    assert library.entries()[0].name == "The moon" and library.entries()[0].what == str(source)
    library.delete(place.key)
    assert library.entries() == () and not source.exists()
    with pytest.raises(UnknownNameError):
        library.delete(place.key)


def test_two_places_have_two_names(tmp_path: Path) -> None:
    library = PlaceLibrary(tmp_path)
    brought(library)
    brought(library, content=b"another")
    assert {place.name for place in library.entries()} == {"moon", "moon 2"}
    with pytest.raises(NameRefusedError, match="already"):
        library.rename(library.entries()[0].key, "moon 2")
    for bad in ("", "../x", ".hidden", "a" * 61, "dot."):
        with pytest.raises(NameRefusedError):
            library.rename(library.entries()[0].key, bad)


def test_files_elsewhere_are_none_of_its_business(tmp_path: Path) -> None:
    library, own = PlaceLibrary(tmp_path / "library"), tmp_path / "mine.splat"
    own.write_bytes(b"splats")
    assert not library.holds(own) and library.opened(own, own, b"") is None and library.entries() == ()


@pytest.mark.parametrize("about", ["{}", "[]", "nonsense", '{"name": "x", "source": "../y", "date": "", "field": "z"}'])
def test_a_damaged_entry_is_passed_over(tmp_path: Path, about: str) -> None:
    brought(PlaceLibrary(tmp_path)).with_name("place.json").write_text(about)
    assert PlaceLibrary(tmp_path).entries() == ()


def test_a_folder_that_cannot_be_written_is_told_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(UploadError, match=r"moon\.splat cannot be kept"):
        PlaceLibrary(tmp_path / "file").keep("moon.splat", b"splats")
