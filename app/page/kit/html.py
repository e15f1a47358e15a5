"""HTML snippets: legends, tables and notes that several panels use. All text is escaped here."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import NamedTuple

import numpy as np

from nerfnav_app.page.kit.theme import CAUTION, HIT, MUTED, START, Rgb, css, on_scale, readable


@dataclass(frozen=True)
class LegendEntry:
    """Entry of a legend: a colour and its meaning."""

    color: Rgb
    meaning: str


ROW = '<span class="nerfnav-row"></span>'
"""Mark before three buttons that page.css puts into a row."""
_PADDING = "padding: 0 0.75em 0.5em 0.75em; font-size: 0.8125em; line-height: 1.45; text-wrap: pretty;"


def note(text: str) -> str:
    """Format a remark in the muted colour."""
    return f'<div style="{_PADDING} color: {MUTED}">{escape(text)}</div>'


def code(text: str) -> str:
    """Format a line to copy: one click selects all of it."""
    return (
        f'<div style="{_PADDING}"><code title="One click selects it, Ctrl+C copies it" style="user-select: all; '
        f'display: block; overflow-wrap: anywhere; cursor: pointer; color: {MUTED}">{escape(text)}</code></div>'
    )


def warning(text: str) -> str:
    """Format a warning in the colour of hits."""
    return f'<div style="{_PADDING} color: {readable(HIT)}">{escape(text)}</div>'


def caution(text: str) -> str:
    """Format in amber what is neither good nor bad."""
    return f'<div style="{_PADDING} color: {readable(CAUTION)}">{escape(text)}</div>'


def fine(text: str) -> str:
    """Format good news in the colour of the start."""
    return f'<div style="{_PADDING} color: {readable(START)}">{escape(text)}</div>'


def heading(title: str, text: str = "") -> str:
    """Format a title, with a muted line below it where there is a text."""
    below = f'<div style="color: {MUTED}; font-size: 0.8125em">{escape(text)}</div>' if text else ""
    return (
        f'<div style="padding: 0.25em 0.75em {0.5 if text else 0.1}em 0.75em; line-height: 1.4">'
        f'<div style="font-weight: 600; font-size: 0.95em">{escape(title)}</div>{below}</div>'
    )


class Row(NamedTuple):
    """Row of a table: a name, and a value with its unit."""

    name: str
    value: str
    term: str = ""
    """Tooltip with the technical term."""
    color: str = "inherit"
    """Colour of the value, as CSS."""


def table(rows: Iterable[tuple[str, ...]]) -> str:
    """Format rows: the texts of each are those of a `Row`."""
    cells = "".join(
        f'<div style="color: {MUTED}"{_tooltip(row.term)}>{escape(row.name)}</div>'
        f'<div style="text-align: right; font-variant-numeric: tabular-nums; color: {row.color}"{_tooltip(row.term)}>'
        f"{escape(row.value)}</div>"
        for row in (Row(*texts) for texts in rows)
    )
    return f'<div style="{_PADDING} display: grid; grid-template-columns: auto auto; gap: 0.05em 1em">{cells}</div>'


def _tooltip(text: str) -> str:
    return f' title="{escape(text)}"' if text else ""


class EventEntry(NamedTuple):
    """Event of a list: its text, and the tooltip that explains it."""

    text: str
    term: str


def events(entries: Iterable[EventEntry]) -> str:
    """Format events in lines that wrap."""
    items = "".join(
        f'<span style="white-space: nowrap; margin-right: 0.9em; display: inline-block; cursor: help"'
        f"{_tooltip(entry.term)}>{escape(entry.text)}</span>"
        for entry in entries
    )
    return f'<div style="{_PADDING} color: {MUTED}">{items}</div>'


def columns(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format rows of a name and several values under a head of as many columns."""
    titles = "".join(f'<div style="text-align: right; font-weight: 600">{escape(name)}</div>' for name in head[1:])
    cells = "".join(
        f'<div style="color: {MUTED}">{escape(name)}</div>'
        + "".join(
            f'<div style="text-align: right; font-variant-numeric: tabular-nums">{escape(value)}</div>'
            for value in values
        )
        for name, *values in rows
    )
    return (
        f'<div style="{_PADDING} display: grid; grid-template-columns: {" ".join("auto" for _ in head)}; '
        f'gap: 0.05em 1em"><div style="color: {MUTED}">{escape(head[0])}</div>{titles}{cells}</div>'
    )


def scale(low: float, high: float, of: str) -> str:
    """Format a bar in the colours of the scale, with the values at its ends."""
    colors = ", ".join(css((r, g, b)) for r, g, b in on_scale(np.linspace(0, 1, 9)).tolist())
    return (
        f'<div style="{_PADDING} color: {MUTED}"><div style="height: 0.6em; border-radius: 0.3em; '
        f'background: linear-gradient(to right, {colors})"></div><div style="display: flex; '
        f'justify-content: space-between"><span>{low:g}</span><span>{escape(of)}</span><span>≥ {high:g}</span>'
        "</div></div>"
    )


def legend(entries: Iterable[LegendEntry]) -> str:
    """Format a coloured dot for each meaning."""
    items = "".join(
        f'<span style="white-space: nowrap; margin-right: 0.9em; display: inline-block">'
        f'<span style="display: inline-block; width: 0.65em; height: 0.65em; border-radius: 50%; '
        f'background: {css(entry.color)}; margin-right: 0.4em"></span>{escape(entry.meaning)}</span>'
        for entry in entries
    )
    return f'<div style="{_PADDING} color: {MUTED}">{items}</div>'
