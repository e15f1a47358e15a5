"""Report: one self-contained page of what a folder of experiments holds: tables, figures, flights to watch.

It reads the folder of one experiment, or one with such folders in it. Each has results.json, and may have table.md (the
tables for readers), results.md, manifest.json, results.jsonl (trials of an experiment that was interrupted), figures as
PNG and SVG, and replay_NAME.html (flights). What is missing is left out. The page loads nothing from anywhere.
"""

import base64
import html
import itertools
from collections.abc import Collection, Generator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
from tyro.conf import Positional, arg

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.experiments import Replay
from nerfnav.export.replay import replay
from nerfnav.formats import read_record, read_text
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.export.surface import build_surface
from nerfnav_app.jobs.measure.markup import html_of_markdown, html_of_table, text_of
from nerfnav_app.jobs.measure.report_page import Section, page_of
from nerfnav_app.places.place import open_place
from nerfnav_app.storage.experiment_store import lines
from nerfnav_app.storage.output_files import prepare_file, write_bytes

RESULTS, TRIALS, MANIFEST, TABLE, PAGE = "results.json", "results.jsonl", "manifest.json", "table.md", "results.md"
"""Files that are read from each folder; PAGE is that of a folder with several experiments."""
_REPLAY = "replay_"
_LARGEST_SVG = 1_000_000
"""Size from which a figure is shown as PNG [bytes]: the browser draws each of its points."""
_MOST_ROWS = 500


class StoredResults(msgspec.Struct, frozen=True):
    """Results of an experiment, as results.json has them."""

    experiment: str = ""
    summary: dict[str, Any] = {}
    rows: list[dict[str, Any]] = []


class StoredManifest(msgspec.Struct, frozen=True):
    """Settings of an experiment, as manifest.json has them."""

    settings: dict[str, Any] = {}
    version: str = ""
    commit: str | None = None
    machine: dict[str, Any] = {}


@dataclass(frozen=True)
class ReportRequest:
    """Request of a report. The command line reads it as it is."""

    folder: Annotated[Positional[Path], arg(metavar="DIR")]
    """Folder of an experiment, or of several."""
    out: Path | None = None
    """HTML file (default: report.html in the folder)."""


def run(request: ReportRequest) -> JobEvents:
    """Write the page; return what is in it. Raises InvalidInputError for a folder without experiments."""
    find_experiments(request.folder)
    out = prepare_file(request.out or request.folder / "report.html")
    sections = yield from read_sections(request.folder)
    write_bytes(out, make_page(request.folder, sections))
    count = {name: sum(len(getattr(section, name)) for section in sections) for name in ("figures", "replays")}
    summary = {"experiments": [section.name for section in sections], **count, "bytes": out.stat().st_size}
    return JobResult(summary, (out,))


def make_page(folder: Path, sections: Sequence[Section]) -> bytes:
    """Page of a folder with these sections; halves of surrogate pairs, which JSON can hold, become question marks."""
    return page_of(folder.resolve().name, sections).encode(errors="replace")


def read_sections(folder: Path) -> Generator[Progress, bool | None, list[Section]]:
    """Yield which experiment is read, and return all. Raises InvalidInputError where one cannot be read."""
    folders, sections = find_experiments(folder), []
    names = {each.name for each in folders}
    for index, each in enumerate(folders):
        yield Progress(f"reading {each.name}", index / len(folders))
        try:
            sections.append(read_section(each, names))
        except RecursionError as error:
            raise InvalidInputError(f"{each / RESULTS} has values in values, too deep to be shown") from error
    return sections


def find_experiments(folder: Path) -> list[Path]:
    """Folders of experiments: this one, and those in it. Raises InvalidInputError where there are none."""
    if not folder.is_dir():
        raise InvalidInputError(f"there is no folder {folder}: name the one that `nerfnav experiment --out` wrote")
    found = [path for path in (folder, *sorted(folder.iterdir())) if _holds_experiment(path)]
    if not found:
        raise InvalidInputError(
            f"{folder} holds no experiment (no {RESULTS}): make one with `nerfnav experiment NAME --out {folder}`"
        )
    return found


def _holds_experiment(folder: Path) -> bool:
    return any((folder / name).is_file() for name in (RESULTS, TRIALS))


def read_section(folder: Path, others: Collection[str] = ()) -> Section:
    """Read the folder of one experiment; the part of PAGE on experiments that have a section is left out.

    Raises InvalidInputError, with the file, for what cannot be read.
    """
    results, manifest = _record(folder / RESULTS, StoredResults), _record(folder / MANIFEST, StoredManifest)
    name = folder.resolve().name if results is None else results.experiment or folder.resolve().name
    texts = [read_text(folder / file) for file in (PAGE, TABLE) if (folder / file).is_file()]
    parts = [html_of_markdown(_before(text, others), 1) for text in texts] or [f"<h2>{html.escape(name)}</h2>"]
    if manifest is not None:
        parts.append(_about(manifest))
    if results is None:
        ended = read_text(folder / TRIALS).count("\n")  # a line that was cut has no end
        parts.append(f"<p>Interrupted: {ended} trials have ended. The same command goes on.</p>")
    elif not texts:
        parts.append(html_of_table(("", "value"), lines(results.summary)))
    flights = {path.stem.removeprefix(_REPLAY): path for path in sorted(folder.glob(f"{_REPLAY}*.html"))}
    replays = {title: read_text(path) for title, path in flights.items() if path.is_file()}
    return Section(name, "\n".join(parts), _figures(folder), replays, "" if results is None else _rows(results.rows))


def _before(text: str, names: Collection[str]) -> str:
    """Markdown up to the first heading that is one of the names."""
    headings = {f"## {name}" for name in names}
    kept = itertools.takewhile(lambda line: line.strip() not in headings, text.splitlines())
    return "\n".join(kept)


def _record(path: Path, kind: type[Any]) -> Any:
    return read_record(path, kind)[0] if path.is_file() else None


def _about(manifest: StoredManifest) -> str:
    """Sentence on what a reader needs to repeat the numbers."""
    known = {"version": manifest.version, "commit": manifest.commit} | manifest.settings | manifest.machine
    said = [f"{name} {text_of(value)}" for name, value in known.items() if value not in (None, "", [], {})]
    return f'<p class="muted">{html.escape(", ".join(said))}</p>'


def _figures(folder: Path) -> dict[str, str]:
    """Each figure as a data URL: SVG where there is one that is not too large, else PNG."""
    found: dict[str, Path] = {}
    for path in (*sorted(folder.glob("*.png")), *sorted(folder.glob("*.svg"))):
        if path.is_file() and (path.stem not in found or path.stat().st_size <= _LARGEST_SVG):
            found[path.stem] = path
    return {stem: _data_url(path) for stem, path in sorted(found.items())}


def _data_url(path: Path) -> str:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InvalidInputError(f"{path} cannot be read: {error.strerror}") from error
    kind = "svg+xml" if path.suffix == ".svg" else "png"
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"


def _rows(rows: list[dict[str, Any]]) -> str:
    names = list(dict.fromkeys(name for row in rows for name in row))
    shown = [[text_of(row.get(name)) for name in names] for row in rows[:_MOST_ROWS]]
    more = f"<p>The first {_MOST_ROWS} of {len(rows)}.</p>" if len(rows) > _MOST_ROWS else ""
    return more + html_of_table(names, shown) if rows else ""


def write_replays(folder: Path, replays: Mapping[str, Replay]) -> tuple[Path, ...]:
    """Fly and write the flights of an experiment that a report shows, as replay_NAME.html."""
    files = []
    for name, flight in replays.items():
        try:
            recording = flight.record()
        except NerfnavError:  # the experiment has this trial as one that failed, with the reason
            continue
        if recording is not None:
            page = replay(recording.with_surface(_surface(flight.place))).content
            files.append(write_bytes(folder / f"{_REPLAY}{name}.html", page))
    return tuple(files)


def _surface(place: str) -> bytes | None:
    """Surface of a bundled scene; None for a place that has no field of its name, and is shown by its flights alone."""
    try:
        return build_surface(open_place(place)) or None
    except NerfnavError:
        return None
