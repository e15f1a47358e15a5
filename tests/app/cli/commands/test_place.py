"""`nerfnav place` from its words to its file."""

from pathlib import Path

import pytest

from nerfnav.field.storage.checkpoint import load_field, save_field
from tests.app.cli.test_main import printed, refused
from tests.field.moves import room

MEASURE = ["--measure", "0,0,0", "0.3,0.4,0", "1"]


@pytest.fixture
def field(tmp_path: Path) -> str:
    """A small place in a file."""
    save_field(room(), tmp_path / "room.npz")
    return str(tmp_path / "room.npz")


def test_points_may_be_written_with_commas_or_spaces(
    field: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for number, words in enumerate((MEASURE, ["--measure", "0", "0", "0", "0.3", "0.4", "0", "1"])):
        out = tmp_path / f"{number}.npz"
        summary = printed(["place", field, *words, "--out", str(out)], capsys)
        assert summary["changed"][0].startswith("a metre of before is 2 m now")
        assert load_field(out).box.size[0].item() == pytest.approx(2.4)


def test_a_box_is_kept_after_scale(field: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--scale", "2", "--box", "-1", "-1", "0", "1", "1", "1.2", "--out", str(tmp_path / "part.npz")]
    summary = printed(["place", field, *words], capsys)
    assert summary["box"]["upper"] == pytest.approx([1.0, 1.0, 1.2], abs=0.04)
    assert 0 < summary["geometry"]["unproven_share"] < 1


def test_a_turn_is_about_x_then_y_then_z_and_floor_and_box_come_after_it(
    field: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, out = load_field(field_path := Path(field)), tmp_path / "turned.npz"
    summary = printed(["place", str(field_path), "--turn", "90,0,90", "--out", str(out)], capsys)
    assert summary["changed"][0] == "turned by 120 degrees", "two quarter turns are a third of a turn"
    turned = load_field(out)
    x, y, z = before.box.size.tolist()
    assert turned.box.size.tolist() == pytest.approx([z, x, y], abs=1e-5), "x to y, y to z, z to x"
    words = ["--turn", "10", "0", "0", "--up", "0,-0.173648,0.984808", "--out", str(tmp_path / "back.npz")]
    printed(["place", field, *words], capsys)
    assert load_field(tmp_path / "back.npz").box.size.tolist() == pytest.approx([x, y, z], abs=0.2)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--turn", "0", "0", "0"], "nothing is to be changed: give --turn"),
        (["--turn", "1", "nan", "0"], "finite"),
        (["--turn", "1", "2"], "turn takes 3 numbers, not 2"),
        ([], "nothing is to be changed"),
        (["--measure", "0,0,0", "0,0,0", "1"], "the two points are the same"),
        (["--measure", "0,0,0", "1,0,0", "0"], "the distance must be a number above 0"),
        (["--measure", "0,0,0", "1,0"], "measure takes 7 numbers, not 5"),
        (["--floor", "0,0,0", "1,1,1", "2,2,2"], "lie on one line"),
        (["--floor", "0,0,0", "1,1,nan", "2,2,2"], "finite numbers"),
        (["--box", "5,5,5", "6,6,6"], "outside the place"),
        ([*MEASURE, "--scale", "2"], "either a measured distance or a scale"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_sentence(
    words: list[str], said: str, field: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in refused(["place", field, *words, "--out", str(tmp_path / "out.npz")], capsys)
    assert not (tmp_path / "out.npz").exists()
