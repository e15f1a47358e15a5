"""What is kept comes back as it was, and nothing that goes wrong with a cache is more than time lost."""

from collections.abc import Callable
from pathlib import Path

import pytest

from nerfnav.core.cache import cache_root, hash_code, load_or_make


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of the test's own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "nerfnav" / "things"


def counted(made: list[bytes], content: bytes) -> Callable[[], bytes]:
    """Makes `content`, and notes that it did."""

    def make() -> bytes:
        made.append(content)
        return content

    return make


def test_what_was_made_once_is_not_made_again_for_the_same_key() -> None:
    made: list[bytes] = []
    assert [load_or_make("things", key, counted(made, key * 2)) for key in (b"a", b"a", b"b", b"a")] == [
        b"aa",
        b"aa",
        b"bb",
        b"aa",
    ]
    assert made == [b"aa", b"bb"]


def test_a_torn_file_is_made_again(folder: Path) -> None:
    made: list[bytes] = []
    load_or_make("things", b"a", counted(made, b"x" * 1000))
    (file,) = folder.iterdir()
    file.write_bytes(file.read_bytes()[:500])
    assert load_or_make("things", b"a", counted(made, b"x" * 1000)) == b"x" * 1000 and len(made) == 2


def test_a_cache_that_cannot_be_written_only_costs_time(folder: Path) -> None:
    folder.parent.mkdir()
    folder.write_text("a file where the folder should be")
    assert load_or_make("things", b"a", lambda: b"made") == b"made"


def test_only_the_latest_are_kept(folder: Path) -> None:
    for key in range(30):
        load_or_make("things", bytes([key]), lambda: b"")
    assert len(list(folder.iterdir())) == 12


def test_the_digest_of_code_changes_with_the_code(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("one")
    before = hash_code(tmp_path)
    (tmp_path / "notes.txt").write_text("no code")
    assert hash_code(tmp_path) == before
    (tmp_path / "a.py").write_text("two")
    assert hash_code(tmp_path) != before


def test_the_cache_is_where_the_user_wants_it(tmp_path: Path) -> None:
    assert cache_root() == tmp_path / "nerfnav"
