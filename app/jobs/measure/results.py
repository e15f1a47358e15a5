"""Results of an experiment as files: JSON, a table, figures."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from nerfnav.experiments import Results, Row
from nerfnav_app.storage.output_files import json_line, write_bytes, write_text

if TYPE_CHECKING:
    import matplotlib.figure


def save_results(folder: Path, name: str, results: Results, figures: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Write results.json, the table as NAME.csv, and each figure, given as PNG."""
    content = {"experiment": name, "summary": results.summary, "rows": list(results.rows)}
    files = [write_text(folder / "results.json", json_line(content) + "\n")]
    if results.rows:
        files.append(write_text(folder / f"{name}.csv", table_text(results.rows)))
    return (*files, *(write_bytes(folder / f"{title}.png", png) for title, png in figures.items()))


def table_text(rows: Sequence[Row]) -> str:
    """CSV of lines that all have the same names."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(
        {name: f"{cell:.9g}" if isinstance(cell, float) else cell for name, cell in row.items()} for row in rows
    )
    return stream.getvalue()


def png_of(figure: "matplotlib.figure.Figure") -> bytes:
    """A drawing as PNG."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    return stream.getvalue()
