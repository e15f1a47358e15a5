"""The house that the opening of meshes is timed with, and the words that `bench open` takes."""

from pathlib import Path

import pytest
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav_app.benchmarks import opening
from nerfnav_app.benchmarks.house import write_house
from nerfnav_app.cli.main import BAD_INPUT, main
from nerfnav_app.jobs.measure.opening import OpeningRequest, run
from tests.app.following import result_of


def test_the_house_is_furnished_and_20_m_long(tmp_path: Path) -> None:
    write_house(tmp_path / "house.glb")
    house = trimesh.load(tmp_path / "house.glb")
    assert isinstance(house, trimesh.Scene)
    assert sorted(house.extents.round(1).tolist()) == [3.0, 12.0, 20.0]
    assert sum(len(part.faces) for part in house.geometry.values()) > 100_000
    write_house(tmp_path / "again.glb")
    assert (tmp_path / "again.glb").read_bytes() == (tmp_path / "house.glb").read_bytes()


def test_known_files_of_a_folder_are_timed_after_the_house(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def measure(file: Path | None, seconds: float) -> dict[str, dict[str, float]]:
        return {"house.glb" if file is None else file.name: {"shown": seconds}}

    monkeypatch.setattr(opening, "measure", measure)
    with pytest.raises(InvalidInputError, match=r"holds none of warehouse\.glb, redkitchen"):
        result_of(run(OpeningRequest("open", data=tmp_path)))
    (tmp_path / "fox").mkdir()
    (tmp_path / "warehouse.glb").touch()
    rows = result_of(run(OpeningRequest("open", data=tmp_path))).summary["open"]
    assert list(rows) == ["house.glb", "warehouse.glb", "fox"]


@pytest.mark.slow
def test_files_that_cannot_be_timed_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "words.glb").write_text("words")
    for words in ([str(tmp_path / "missing.glb")], [str(tmp_path)], ["--color-s", "0"]):
        assert main(["bench", "open", *words]) == BAD_INPUT
        assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_times_are_told_by_name_with_the_bars(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    times = {"shown": 1.0, "planned": 9.5, "flown": None, "full": 70.0}
    monkeypatch.setattr(opening, "measure", lambda file, seconds: {"house.glb" if file is None else file.name: times})
    assert result_of(run(OpeningRequest("open"))).summary == {"open": {"house.glb": times}, "bars_s": opening.BARS}


@pytest.mark.nightly
def test_a_house_is_shown_planned_in_and_flown_in() -> None:
    (row,) = opening.measure(seconds=5.0).values()
    assert row["shown"] < row["planned"] < row["flown"] < row["full"]
    assert row["position_p95_m"] < 0.1
