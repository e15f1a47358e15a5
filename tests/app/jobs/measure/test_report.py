"""Reports: what a folder of experiments holds, in one page that needs nothing from anywhere."""

import base64
import html
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.experiments.study import Replay
from nerfnav.export.recording import Recording
from nerfnav_app.cli.main import main
from nerfnav_app.jobs.measure.report import ReportRequest, run, write_replays
from nerfnav_app.storage.output_files import OutputError
from tests.app.following import result_of
from tests.export.flights import flight

PNG = b"\x89PNG\r\n\x1a\n of a figure"


def write_experiment(folder: Path, name: str, **changes: Any) -> Path:
    """The folder of an experiment as it has been from the beginning: results and a figure."""
    folder.mkdir(parents=True)
    rows = [{"task": "a <b> & c", "clean": True, "J": 1.23456, "missing": None}]
    content = {"experiment": name, "summary": {"nerfnav": {"clean": 3, "J_median": 2.5}}, "rows": rows} | changes
    (folder / "results.json").write_text(json.dumps(content))
    (folder / f"{name}.png").write_bytes(PNG)
    return folder


def page_of(folder: Path) -> str:
    result = result_of(run(ReportRequest(folder)))
    assert result.files == (folder / "report.html",)
    return (folder / "report.html").read_text()


def test_a_page_has_the_numbers_the_figures_and_all_trials(tmp_path: Path) -> None:
    page = page_of(write_experiment(tmp_path / "rivals", "rivals"))
    assert "<h2>rivals</h2>" in page and "nerfnav.J median" in page and '<td class="n">2.5</td>' in page
    assert f"data:image/png;base64,{base64.b64encode(PNG).decode()}" in page
    assert "a &lt;b&gt; &amp; c" in page and ">1.235<" in page and ">yes<" in page and ">–<" in page


def test_tables_for_readers_take_the_place_of_the_bare_numbers(tmp_path: Path) -> None:
    folder = write_experiment(tmp_path / "rivals", "rivals")
    table = "|  | a \\| b |\n| --- | ---: |\n| J | 2.5 ms |"
    text = f"# rivals\n\nThe purpose, by `nerfnav`.\n\n## methods\n\n{table}\n\n- one\n- **two**\n"
    (folder / "table.md").write_text(text)
    page = page_of(folder)
    assert "<h2>rivals</h2>" in page and "<h3>methods</h3>" in page and "<code>nerfnav</code>" in page
    assert "a | b</th>" in page and '<td class="n">2.5 ms</td>' in page and "---" not in page
    assert "<ul><li>one</li><li><b>two</b></li></ul>" in page and "nerfnav.J median" not in page


@pytest.mark.parametrize(
    "text", ["", "\n", "| --- |", "|", "| a |\n|---|", "#", "####### deep", "- ", "a | b", "| a\n| b | c |"]
)
def test_any_text_for_readers_makes_a_page(text: str, tmp_path: Path) -> None:
    folder = write_experiment(tmp_path / "rivals", "rivals")
    (folder / "table.md").write_text(text)
    assert "</html>" in page_of(folder)


def test_a_folder_of_several_has_a_section_for_each_and_its_own_page_first(tmp_path: Path) -> None:
    write_experiment(tmp_path / "all", "all", summary={"wall_s": 12.0})
    for name in ("flights", "rivals"):
        write_experiment(tmp_path / "all" / name, name)
    (tmp_path / "all" / "notes").mkdir()
    (tmp_path / "all" / "results.md").write_text("# Results\n\nBeside the paper.\n\n## rivals\n\nonce more\n")
    page = page_of(tmp_path / "all")
    assert re.findall(r'<a href="#s\d">(.*?)</a>', page) == ["all", "flights", "rivals"]
    assert "Beside the paper." in page and "once more" not in page, "rivals has a section of its own"
    assert page.count("<section") == 3


def test_settings_and_machine_are_stated(tmp_path: Path) -> None:
    folder = write_experiment(tmp_path / "rivals", "rivals")
    manifest = {"version": "1.2", "commit": None, "settings": {"seed": 7}, "machine": {"cores": 2}, "hash": "x"}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    assert "version 1.2, seed 7, cores 2" in page_of(folder)


def test_an_interrupted_experiment_says_how_far_it_is(tmp_path: Path) -> None:
    (tmp_path / "results.jsonl").write_text('{"trial": 0}\n{"trial": 1}\n{"tri')
    page = page_of(tmp_path)
    assert "3 trials" not in page and "2 trials have ended" in page


def test_a_figure_is_shown_as_svg_unless_that_is_large(tmp_path: Path) -> None:
    folder = write_experiment(tmp_path / "rivals", "rivals")
    (folder / "rivals.svg").write_text("<svg/>")
    assert "data:image/svg+xml" in page_of(folder) and "data:image/png" not in page_of(folder)
    (folder / "rivals.svg").write_text("<svg/>" + " " * 2_000_000)
    assert "data:image/svg+xml" not in page_of(folder) and "data:image/png" in page_of(folder)


def test_flights_are_embedded_in_frames_without_rights(tmp_path: Path) -> None:
    folder = write_experiment(tmp_path / "flights", "flights")
    records: dict[str, Callable[[], Recording | None]] = {"camera": flight, "refused": lambda: None, "failed": fail}
    files = write_replays(folder, {name: Replay("no such place", record) for name, record in records.items()})
    assert [path.name for path in files] == ["replay_camera.html"], "two did not begin"
    page = page_of(folder)
    (frame,) = re.findall(r'<iframe sandbox="allow-scripts" .*? srcdoc="(.*?)"', page, re.DOTALL)
    assert html.unescape(frame) == files[0].read_text() and "a helix" in frame
    assert result_of(run(ReportRequest(folder))).summary["replays"] == 1


def fail() -> None:
    raise NerfnavError("no room for random ends")


def test_the_page_needs_nothing_from_anywhere_and_texts_cannot_break_out(tmp_path: Path) -> None:
    hostile = '"><script>alert(1)</script>'
    told = {hostile: hostile}
    folder = write_experiment(tmp_path / "x", hostile.replace("/", "|"), summary=told, rows=[told])
    table = f"| {hostile} |\n| --- |\n| {hostile} |"
    (folder / "table.md").write_text(f"# {hostile}\n\n{hostile}\n\n{table}\n\n- {hostile}\n")
    (folder / 'replay_"onload=".html').write_text("<p>flight</p>")
    page = page_of(folder)
    assert "<script" not in page and not re.search(r"onload=\"[^\"]", page)
    assert not re.search(r"(src|href)=\"(?!data:|#)|https?://|@import|url\(", page)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "not readable as JSON"),
        ('{"summary": {"a": 1}, "rows": [', "not readable as JSON"),
        ("[1, 2]", "results.json"),
        ('{"summary": 3}', "summary"),
        ('{"rows": {"a": 1}}', "rows"),
        ('{"rows": [3]}', "rows"),
        ('{"experiment": 3}', "experiment"),
        pytest.param('{"rows": [{"a": ' + 600 * "[" + 600 * "]" + "}]}", "too deep", id="deep"),
    ],
)
def test_damaged_results_are_refused_in_one_sentence(
    content: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "results.json").write_text(content)
    assert main(["report", str(tmp_path)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and message in err and "results.json" in err and len(err.strip().splitlines()) == 1


@pytest.mark.parametrize("summary", [{}, {"a": []}, {"a": {"b": {"c": [1, None, {"d": 1e400}]}}}, {"": {"": "\ud800"}}])
@pytest.mark.parametrize("rows", [[], [{}], [{"a": 1}, {"b": [None, True]}], [{"a": {"b": 1}}]])
def test_any_value_of_results_makes_a_page(summary: dict[str, Any], rows: list[dict[str, Any]], tmp_path: Path) -> None:
    assert "</html>" in page_of(write_experiment(tmp_path / "x", "x", summary=summary, rows=rows))


def test_a_folder_without_experiments_is_refused_with_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"holds no experiment .*nerfnav experiment NAME --out"):
        result_of(run(ReportRequest(tmp_path)))
    for wrong in (tmp_path / "nowhere", write_experiment(tmp_path / "x", "x") / "results.json"):
        with pytest.raises(InvalidInputError, match="there is no folder"):
            result_of(run(ReportRequest(wrong)))


def test_a_page_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    folder = write_experiment(tmp_path / "x", "x")
    with pytest.raises(OutputError):
        result_of(run(ReportRequest(folder, folder)))


def test_the_command_prints_what_is_in_the_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_experiment(tmp_path / "x", "x")
    assert main(["report", str(tmp_path), "--out", str(tmp_path / "own.html"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out.splitlines()[-1])
    size = (tmp_path / "own.html").stat().st_size
    assert printed == {"experiments": ["x"], "figures": 1, "replays": 0, "bytes": size}
