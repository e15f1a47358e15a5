"""Typed records: what fits is read, and what does not is one sentence with the key's path."""

from pathlib import Path
from typing import Annotated, ClassVar

import pytest
from msgspec import Meta, Struct

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats.record import (
    FileName,
    KeyReport,
    Number,
    Pixels,
    Positive,
    convert_record,
    parse_yaml,
    read_record,
    report_keys,
)


class Part(Struct):
    """An entry of a list."""

    IGNORED: ClassVar[dict[str, str]] = {"sharpness": "nobody asks for it"}

    file_path: FileName
    fl_x: Number | None = None
    scale: Positive | None = None
    w: Pixels | None = None
    rows: list[list[Number]] = []
    fisheye: bool = False


class Whole(Struct):
    """A file with a list."""

    frames: Annotated[list[Part], Meta(min_length=1)]


def written(folder: Path, content: str | bytes) -> Path:
    path = folder / "a.json"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize(
    ("entry", "sentence"),
    [
        ('"fl_x": "abc"', 'frames[1].fl_x is "abc", a number is needed'),
        ('"fl_x": true', "frames[1].fl_x is true, a number is needed"),
        ('"fl_x": NaN', "frames[1].fl_x is NaN, a finite number is needed"),
        ('"fl_x": -Infinity', "frames[1].fl_x is infinite, or too large a number, a finite number is needed"),
        ('"fl_x": 1' + 400 * "0", "frames[1].fl_x is infinite, or too large a number, a finite number is needed"),
        ('"fl_x": 1' + 5000 * "0", "frames[1].fl_x is infinite, or too large a number, a finite number is needed"),
        ('"fl_x": 1e13', "frames[1].fl_x is 10000000000000.0, a finite number is needed"),
        ('"fl_x": {}', "frames[1].fl_x is a set of keys, a number is needed"),
        ('"scale": 0', "frames[1].scale is 0, a number above 0 is needed"),
        ('"w": 640.5', "frames[1].w is 640.5, a number without a fraction is needed"),
        ('"w": 0', "frames[1].w is 0, a number at least 1 is needed"),
        ('"w": 1e9', "frames[1].w is 1000000000.0, a number at most 65536 is needed"),
        ('"file_path": 3', "frames[1].file_path is 3, a text is needed"),
        ('"file_path": ""', 'frames[1].file_path is "", a text that can name a file is needed'),
        ('"file_path": "a\\u0000"', 'frames[1].file_path is "a\\u0000", a text that can name a file is needed'),
        ('"file_path": "\\ud800"', 'frames[1].file_path is "\\ud800", a text that can name a file is needed'),
        ('"rows": [[1, 2], [3, "x"]]', 'frames[1].rows[1][1] is "x", a number is needed'),
        ('"fisheye": 1', "frames[1].fisheye is 1, true or false is needed"),
    ],
)
def test_a_wrong_value_is_named_by_its_path(tmp_path: Path, entry: str, sentence: str) -> None:
    path = written(tmp_path, f'{{"frames": [{{"file_path": "z"}}, {{"file_path": "a", {entry}}}]}}')
    with pytest.raises(InvalidInputError) as caught:
        read_record(path, Whole)
    assert str(caught.value) == f"{path}: {sentence}"


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "is not readable as JSON"),
        (b"{", "is not readable as JSON"),
        (100_000 * b"[", "is not readable as JSON"),
        (b"\x80abc", "is not readable as text: byte 0"),
        (b"[]", ": the file is a list of 0, a set of keys with values is needed"),
        (b"{}", ": the file has no frames"),
        (b'{"frames": []}', ": frames is a list of 0, a list with a length of at least 1 is needed"),
        (b'{"frames": [{}]}', ": frames[0] has no file_path"),
        (b'{"frames": [3]}', ": frames[0] is 3, a set of keys with values is needed"),
        (b'{"frames": [{"file_path": "a", "\\ud800": 1}]}', "has the key \\ud800, which is no text"),
    ],
)
def test_a_file_of_another_kind_is_one_sentence(tmp_path: Path, content: bytes, sentence: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        read_record(written(tmp_path, content), Whole)
    assert sentence in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_text_is_read_by_its_byte_order_mark(tmp_path: Path, encoding: str) -> None:
    path = written(tmp_path, '{"frames": [{"file_path": "h\N{LATIN SMALL LETTER O WITH STROKE}st"}]}'.encode(encoding))
    assert read_record(path, Whole)[0].frames[0].file_path == "h\N{LATIN SMALL LETTER O WITH STROKE}st"


def test_numbers_of_yaml_may_be_texts() -> None:
    (content,) = parse_yaml("frames: [{file_path: a, fl_x: 1e-3}]", "a.yaml")
    assert convert_record(content, Whole, "a.yaml", strict=False).frames[0].fl_x == 1e-3


@pytest.mark.parametrize("text", ["a: 2020-13-45", "a: !!int x", "a: 1" + 5000 * "0", 3000 * "[", "? [1]\n: 2"])
def test_yaml_that_cannot_be_parsed_is_one_sentence(text: str) -> None:
    with pytest.raises(InvalidInputError, match=r"^a\.yaml is not readable as YAML: .*$"):
        parse_yaml(text, "a.yaml")


def test_keys_are_used_ignored_or_unknown() -> None:
    parts = [{"file_path": "a", "sharpness": 3.0}, {"file_path": "b", "shapness": 3.0}]
    keys = report_keys({"frames": parts, "more": 1}, Whole)
    assert keys.used == ("frames", "frames[].file_path")
    assert keys.ignored == {"frames[].sharpness": "nobody asks for it"}
    assert keys.unknown == ("frames[].shapness", "more")
    assert keys.ignoring("no reason", "frames", "other").ignored.keys() == {"frames[].sharpness", "frames"}
    assert KeyReport(("a",), {}, ("b",)).merge(KeyReport(("a", "c"), {"d": "e"}, ("b",))) == KeyReport(
        ("a", "c"), {"d": "e"}, ("b",)
    )
