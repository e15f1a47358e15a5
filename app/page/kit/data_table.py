"""Table of several columns, whose cells may have two lines: its heads and rows can be picked by a click.

A pick sets the value of a hidden widget, which picks.js sends; see `Picks`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import viser

from nerfnav_app.page.kit.theme import MUTED, Rgb, css, readable


@dataclass(frozen=True)
class Text:
    """One line of a head or of a cell."""

    text: str
    color: Rgb | None = None
    """Of the text; None for that of all texts."""
    dot: Rgb | None = None
    """Of a dot before the text, as in a legend."""
    muted: bool = False
    """Secondary text."""
    pick: str = ""
    """Value that a click picks; empty where it picks nothing."""
    hint: str = ""
    """Tooltip."""


@dataclass(frozen=True)
class Column:
    """Column of a table: the lines of its head."""

    head: Sequence[Text]
    number: bool = False
    """Align its cells to the right."""


@dataclass(frozen=True)
class Row:
    """Row of a table."""

    cells: Sequence[Sequence[Text]]
    """Lines of the cell of each column."""
    pick: str = ""
    """Value that a click on the row picks; empty where it picks nothing."""
    picked: bool = False
    """Draw it as the picked one."""
    hover: str = ""
    """Value that is picked while the pointer is over the row; empty where none is."""
    rest: str = ""
    """Value that is picked when the pointer leaves the row."""


class Picks:
    """Hidden widget that takes the picks of a table."""

    def __init__(self, server: viser.ViserServer, take: Callable[[str], None]) -> None:
        """Add the widget; `take` gets each picked value, as a browser sends it: any text."""
        self.widget = server.gui.add_text("Picked", "", visible=False)
        self._take = take
        self.widget.on_update(self._update)

    @property
    def id(self) -> str:
        """Identify the widget for `data_table`."""
        return self.widget._impl.uuid

    async def _update(self, event: viser.GuiEvent[Any]) -> None:
        value = str(self.widget.value)
        if event.client is None or not value:
            return
        self.widget.value = ""  # or the next pick of the same value would change nothing
        self._take(value)


def data_table(columns: Sequence[Column], rows: Sequence[Row], picks: str = "") -> str:
    """Format a table as HTML; `picks` identifies the widget that its heads and rows set."""
    head = "".join(f"<th{_number(column)}>{_lines(column.head, picks)}</th>" for column in columns)
    body = "".join(_row(columns, row, picks) for row in rows)
    return (
        f'<div class="nerfnav-table" tabindex="0"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _row(columns: Sequence[Column], row: Row, picks: str) -> str:
    cells = "".join(
        f"<td{_number(column)}>{_lines(lines, picks)}</td>" for column, lines in zip(columns, row.cells, strict=True)
    )
    hover = f' data-hover="{escape(row.hover)}" data-rest="{escape(row.rest)}"' if row.hover else ""
    picked = ' class="picked" aria-selected="true"' if row.picked else ""
    return f"<tr{_pick(row.pick, picks)}{hover}{picked}>{cells}</tr>"


def _lines(lines: Sequence[Text], picks: str) -> str:
    return "<br>".join(_text(line, picks) for line in lines)


def _text(line: Text, picks: str) -> str:
    color = MUTED if line.muted else "" if line.color is None else readable(line.color)
    style = f' style="color: {color}"' if color else ""
    hint = f' title="{escape(line.hint)}"' if line.hint else ""
    dot = ""
    if line.dot is not None:
        dot = (
            f'<span style="display: inline-block; width: 0.65em; height: 0.65em; border-radius: 50%; '
            f'background: {css(line.dot)}; margin-right: 0.4em"></span>'
        )
    return f"<span{style}{hint}{_pick(line.pick, picks)}>{dot}{escape(line.text)}</span>"


def _pick(value: str, picks: str) -> str:
    return f' data-pick="{escape(picks)}" data-value="{escape(value)}" tabindex="0"' if value else ""


def _number(column: Column) -> str:
    return ' class="number"' if column.number else ""
