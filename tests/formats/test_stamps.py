"""Stamped lists of TUM and EuRoC, and the units of stamps."""

from pathlib import Path

import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import parse_nanoseconds, parse_stamp, read_rows, time_in_name


@pytest.mark.parametrize("text", [
    "1.5 rgb/a b.png\n", "1.5\trgb/a b.png\r\n", "1.5,rgb/a b.png", "1.5 , rgb/a b.png,\n", "1.5; rgb/a b.png",
    "\ufeff# timestamp filename\n\n  # more\n1.5   rgb/a b.png  \n", "timestamp,filename\n1.5,'rgb/a b.png'\n",
])  # fmt: skip
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_cells_are_parted_in_every_way(tmp_path: Path, text: str, encoding: str) -> None:
    if encoding == "utf-16":
        text = text.removeprefix("\ufeff")  # the codec writes its own
    (tmp_path / "rgb.txt").write_bytes(text.encode(encoding))
    ((where, cells),) = read_rows(tmp_path / "rgb.txt", 2, named=True)
    assert cells == ["1.5", "rgb/a b.png"] and where.endswith("rgb.txt")


@pytest.mark.parametrize(("text", "said"), [
    ("1.5\n", "line 1 of .* has 1 columns, where 2 are needed"), ("1.5 a\0b\n", r"line 1 of .* names 'a\?b'"),
    ("1.5 " + 2000 * "a", "which no file is called"),
])  # fmt: skip
def test_a_row_without_a_name_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "rgb.txt").write_text(text)
    with pytest.raises(InvalidInputError, match=said):
        read_rows(tmp_path / "rgb.txt", 2, named=True)


@pytest.mark.parametrize(("text", "seconds"), [
    ("1606417097", 1606417097.0), ("1606417097528", 1606417097.528), ("1606417097528152", 1606417097.528152),
    ("1606417097528152123", 1606417097.528152), ("1606417097528.152", 1606417097.528152), ("12.5", 12.5), ("7", 7.0),
    ("1.606417097528152e+09", 1606417097.528152), ("1.606417097528152123e+18", 1606417097.528152), ("-0.5", -0.5),
])  # fmt: skip
def test_stamps_since_1970_have_the_unit_of_their_magnitude(text: str, seconds: float) -> None:
    assert parse_stamp(text, "it") == pytest.approx(seconds, abs=1e-6)


@pytest.mark.parametrize("text", ["nan", "inf", "1e999", "noon", "1_0", "9" * 50, "", "0x10", "١٢"])
def test_what_is_no_number_is_no_stamp(text: str) -> None:
    with pytest.raises(InvalidInputError, match=r"it has .* where a number should be"):
        parse_stamp(text, "it")


@pytest.mark.parametrize(("name", "seconds"), [
    ("1606417097528152", 1606417097.528152), ("1606417097528", 1606417097.528),
    ("1403636579763555584", 1403636579.7635556), ("1305031102.175304", 1305031102.175304),
    ("12.5", 12.5), ("0000000050000000000", 50.0), ("0000000050000000", 0.05),
    ("42", None), ("0000000042", None), ("20261126144628", None), ("frame1.5", None), ("1.5.2", None),
])  # fmt: skip
def test_names_that_count_tell_no_time(name: str, seconds: float | None) -> None:
    assert time_in_name(name) == (None if seconds is None else pytest.approx(seconds, abs=1e-6))


@pytest.mark.parametrize(("stamps", "step"), [
    ([1403636579763555584, 1403636579813555584], 0.05), ([0, 50_000_000, 100_000_000], 0.05),
    ([1_000_000_000_000, 1_000_005_000_000], 0.005), ([1606417097528152, 1606417097628152], 0.1),
    ([1606417097528, 1606417097628], 0.1), (["1606417097.5", "1606417097.55"], 0.05),
    ([950_000_000, 1_000_000_000], 0.05),
])  # fmt: skip
def test_a_table_in_nanoseconds_may_be_in_another_unit(tmp_path: Path, stamps: list[object], step: float) -> None:
    (tmp_path / "data.csv").write_text("".join(f"{stamp},a.png\n" for stamp in stamps))
    times = parse_nanoseconds(read_rows(tmp_path / "data.csv", 2))
    assert times[1] - times[0] == pytest.approx(step, abs=1e-6)
