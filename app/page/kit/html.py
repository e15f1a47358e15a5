"""HTML snippets: legends, tables and notes that several panels use. All text is escaped here."""

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from nerfnav_app.page.kit.theme import HIT, MUTED, START, Rgb, css, on_scale, readable

_PADDING = "padding: 0 0.75em 0.5em 0.75em; font-size: 0.8125em; line-height: 1.45; text-wrap: pretty;"


def note(text: str) -> str:
    """A quiet remark."""
    return f'<div style="{_PADDING} color: {MUTED}">{escape(text)}</div>'


def warning(text: str) -> str:
    """A remark that must be seen."""
    return f'<div style="{_PADDING} color: {readable(HIT)}">{escape(text)}</div>'


def fine(text: str) -> str:
    """A remark that all is well."""
    return f'<div style="{_PADDING} color: {readable(START)}">{escape(text)}</div>'


def heading(title: str, text: str = "") -> str:
    """A title, with a quiet line below it where there is a text."""
    below = f'<div style="color: {MUTED}; font-size: 0.8125em">{escape(text)}</div>' if text else ""
    return (
        f'<div style="padding: 0.25em 0.75em {0.5 if text else 0.1}em 0.75em; line-height: 1.4">'
        f'<div style="font-weight: 600; font-size: 0.95em">{escape(title)}</div>{below}</div>'
    )


def table(rows: Iterable[tuple[str, ...]]) -> str:
    """Names on the left, values with their units on the right; a third text is the term of the field, as a tooltip."""
    cells = "".join(
        f'<div style="color: {MUTED}"{_tooltip(*term)}>{escape(name)}</div>'
        f'<div style="text-align: right; font-variant-numeric: tabular-nums"{_tooltip(*term)}>{escape(value)}</div>'
        for name, value, *term in rows
    )
    return f'<div style="{_PADDING} display: grid; grid-template-columns: auto auto; gap: 0.05em 1em">{cells}</div>'


def _tooltip(text: str = "") -> str:
    return f' title="{escape(text)}"' if text else ""


def columns(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Names on the left, several values beside each other, under a head of as many columns."""
    cells = "".join(f'<div style="text-align: right; font-weight: 600">{escape(name)}</div>' for name in head[1:])
    cells = f'<div style="color: {MUTED}">{escape(head[0])}</div>{cells}'
    for name, *values in rows:
        cells += f'<div style="color: {MUTED}">{escape(name)}</div>'
        cells += "".join(
            f'<div style="text-align: right; font-variant-numeric: tabular-nums">{escape(value)}</div>'
            for value in values
        )
    grid = " ".join("auto" for _ in head)
    return f'<div style="{_PADDING} display: grid; grid-template-columns: {grid}; gap: 0.05em 1em">{cells}</div>'


def scale(low: float, high: float, of: str) -> str:
    """A bar in the colours of the scale, with what its ends mean."""
    colors = ", ".join(css((r, g, b)) for r, g, b in on_scale(np.linspace(0, 1, 9)).tolist())
    return (
        f'<div style="{_PADDING} color: {MUTED}"><div style="height: 0.6em; border-radius: 0.3em; '
        f'background: linear-gradient(to right, {colors})"></div><div style="display: flex; '
        f'justify-content: space-between"><span>{low:g}</span><span>{escape(of)}</span><span>{high:g} and more</span>'
        "</div></div>"
    )


def legend(entries: Iterable[tuple[Rgb, str]]) -> str:
    """A coloured dot for each meaning."""
    items = "".join(
        f'<span style="white-space: nowrap; margin-right: 0.9em; display: inline-block">'
        f'<span style="display: inline-block; width: 0.65em; height: 0.65em; border-radius: 50%; '
        f'background: {css(color)}; margin-right: 0.4em"></span>{escape(meaning)}</span>'
        for color, meaning in entries
    )
    return f'<div style="{_PADDING} color: {MUTED}">{items}</div>'
