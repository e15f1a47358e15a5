"""Results of an experiment as files: JSON, the table as CSV, tables for readers in Markdown, figures."""

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from nerfnav.core.errors import MissingExtraError
from nerfnav.experiments import Results, Row
from nerfnav.experiments.figures import file_of
from nerfnav_app.storage.output_files import json_line, write_bytes, write_text

PERCENTILES = {"p5": 5, "p25": 25, "median": 50, "p75": 75, "p95": 95}
"""Names in the table of percentiles."""
_NO_MEASURES = {"seed", "trial", "index", "step", "iteration", "threads"}
"""Columns of numbers that name a line."""


def save_results(
    folder: Path, name: str, results: Results, figures: Mapping[str, bytes], percentiles: Sequence[Row] = ()
) -> tuple[Path, ...]:
    """Write results.json, the table as NAME.csv, and each figure, given as PNG."""
    content = {"experiment": name, "summary": results.summary, "rows": list(results.rows)}
    content |= {"percentiles": list(percentiles)} if percentiles else {}
    files = [write_text(folder / "results.json", json_line(content) + "\n")]
    if results.rows:
        files.append(write_text(folder / f"{name}.csv", table_text(results.rows)))
    return (*files, *(write_bytes(folder / f"{title}.png", png) for title, png in figures.items()))


def write_folder(folder: Path, name: str, purpose: str, results: Results) -> tuple[Results, tuple[Path, ...]]:
    """Write all files of an experiment; return its results and the files, results.json first.

    Figures that cannot be drawn are left out, and the summary says why.
    """
    drawn: dict[str, tuple[bytes, bytes]] = {}
    try:
        for title, draw in results.figures.items():
            figure = draw()
            drawn[title] = file_of(figure, "png"), file_of(figure, "svg")
    except MissingExtraError as error:
        drawn, left_out = {}, {**results.summary.get("left_out", {}), "figures": str(error)}
        results = replace(results, summary={**results.summary, "left_out": left_out})
    percentiles = percentiles_of(results)
    text = markdown_of(name, f"{purpose[0].upper()}{purpose[1:]}.", results.summary, percentiles)
    files = (
        *save_results(folder, name, results, {title: png for title, (png, _) in drawn.items()}, percentiles),
        *(write_bytes(folder / f"{title}.svg", svg) for title, (_, svg) in drawn.items()),
        write_text(folder / "table.md", text),
    )
    return results, files


def table_text(rows: Sequence[Row]) -> str:
    """CSV of lines that all have the same names."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(
        {name: f"{cell:.9g}" if isinstance(cell, float) else cell for name, cell in row.items()} for row in rows
    )
    return stream.getvalue()


def percentiles_of(results: Results) -> list[Row]:
    """Median and percentiles of each measure in each group of the table: the group, the measure, n and the values."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in results.rows if results.sample is None else results.sample:
        groups.setdefault(tuple(row[name] for name in results.by), []).append(row)
    found = []
    for group, rows in groups.items():
        for measure in rows[0]:
            values = [] if measure in results.by or measure in _NO_MEASURES else _numbers(rows, measure)
            if values:
                spread = dict(zip(PERCENTILES, np.percentile(values, [*PERCENTILES.values()]).tolist(), strict=True))
                known = dict(zip(results.by, group, strict=True))
                found.append(known | {"measure": measure, "n": len(values)} | spread)
    return found


def _numbers(rows: Sequence[Row], measure: str) -> list[float]:
    cells = [row[measure] for row in rows]
    return [
        float(cell)
        for cell in cells
        if isinstance(cell, int | float) and not isinstance(cell, bool) and math.isfinite(cell)
    ]


def markdown_of(title: str, about: str, summary: Row, percentiles: Sequence[Row]) -> str:
    """Tables of a summary and of percentiles, in Markdown."""
    parts = [f"# {title}", about, *tables_of(summary)]
    if percentiles:
        parts += ["## Median and percentiles", table_of(percentiles)]
    return "\n\n".join(parts) + "\n"


def tables_of(summary: Row, heading: str = "") -> list[str]:
    """Tables of a summary: its own numbers, then its records of one kind as columns, then the others by themselves."""
    records = {name: value for name, value in summary.items() if isinstance(value, dict) and value}
    lists = {name: value for name, value in summary.items() if _is_table(value)}
    plain = [name for name in summary if name not in lists and not isinstance(summary[name], dict)]
    alike = {
        name: dict(flatten(value))
        for name, value in records.items()
        if any(value.keys() & other.keys() for other in records.values() if other is not value)
    }
    parts = [table_of([{"": _words(name), "value": summary[name]} for name in plain])] if plain else []
    if alike:
        measures = dict.fromkeys(measure for column in alike.values() for measure in column)
        lines = [{name: column.get(measure) for name, column in alike.items()} for measure in measures]
        parts.append(table_of([{"": _words(name)} | line for name, line in zip(measures, lines, strict=True)]))
    for name in (name for name in records if name not in alike):
        inner = f"{heading}, {_words(name)}" if heading else _words(name)
        parts += [f"## {inner}", *tables_of(records[name], inner)]
    for name, rows in lists.items():
        parts += [f"## {_words(name)}", table_of(rows)]
    return parts


def flatten(summary: Row, before: str = "") -> Iterator[tuple[str, Any]]:
    """Values of nested records, with names such as places.church.reached."""
    for name, value in summary.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{before}{name}.")
        else:
            yield before + name, value


def _is_table(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(entry, dict) for entry in value)


def _words(name: str) -> str:
    return name.replace("_", " ")


def table_of(rows: Sequence[Row]) -> str:
    """A table in Markdown of lines that all have the same names."""
    names = list(rows[0])
    lines = [names, ["---"] * len(names), *([row[name] for name in names] for row in rows)]
    return "\n".join(f"| {' | '.join(map(cell_text, line))} |" for line in lines)


def cell_text(value: Any) -> str:
    """A value as a cell of a table in Markdown."""
    if isinstance(value, bool):
        return ("no", "yes")[value]
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(cell_text(entry) for entry in value)
    return "–" if value is None else " ".join(str(value).replace("|", "\\|").split())
