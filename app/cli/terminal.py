"""Terminal output of a command: its numbers on stdout when it is done, remarks on stderr."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console
from rich.table import Table

from nerfnav_app.storage.output_files import json_line


@dataclass(frozen=True)
class Output:
    """Output of a subcommand, as an option: for people or for programs."""

    json: bool = field(default=False, kw_only=True)
    """Print one JSON object and nothing else."""


_UNITS = {"m": "m", "s": "s", "ms": "ms", "db": "dB", "rad": "rad", "n": "N", "m3": "m³", "bytes": "bytes"}


def show(title: str, summary: dict[str, Any], as_json: bool) -> None:
    """Print a command's numbers: one line of JSON, or a table for people."""
    if as_json:
        sys.stdout.write(json_line(summary) + "\n")
        return
    table = Table(title=title, title_justify="left", show_header=False, box=None, pad_edge=False)
    for name, value in _flat(_without_known_keys(summary)):
        table.add_row(*_row(name, value))
    Console().print(table)


def _without_known_keys(summary: dict[str, Any]) -> dict[str, Any]:
    """The summary for people: of the keys of an input file, those that are not known, if any."""
    keys = summary.get("input_keys") or {}
    unknown = {"unknown_keys": keys["unknown"]} if keys.get("unknown") else {}
    return {name: value for name, value in summary.items() if name != "input_keys"} | unknown


def note(sentence: str) -> None:
    """Tell the user something that is no result."""
    sys.stderr.write(sentence + "\n")


def _flat(summary: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in summary.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name} ")
        elif isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value):
            for number, entry in enumerate(value, 1):
                yield from _flat(entry, f"{prefix}{name} {number} ")
        else:
            yield prefix + name, value


def _row(name: str, value: Any) -> tuple[str, str]:
    """A label and a number with its unit, read from the name's ending: `wall_s` is `wall`, in s."""
    label, _, ending = name.rpartition("_")
    unit = _UNITS.get(ending) if label else None
    text = _text(value)
    if unit is None:
        return name.replace("_", " "), text
    return label.replace("_", " "), f"{text} {unit}" if value is not None else text


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(_text(entry) for entry in value)
    if value is None:
        return "none"
    return ("no", "yes")[value] if isinstance(value, bool) else str(value)
