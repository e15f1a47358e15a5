"""Markup of reports: HTML of Markdown as experiments write it, and of tables.

Headings, paragraphs, lists, tables, `code` and **bold**: everything else is text. All text is escaped.
"""

import html
import re
from collections.abc import Iterator, Sequence
from typing import Any

_BAR = re.compile(r"(?<!\\)\|")
_RULE = re.compile(r"\|?[\s:|-]+\|?")
_NUMBER = re.compile(r"[-+]?[\d.]+(e[-+]?\d+)?( ?[%a-zA-Z/]{0,5})?|–")
_HEADING = re.compile(r"(#{1,6}) +(.*)")


def html_of_markdown(text: str, level: int = 0) -> str:
    """Convert Markdown; headings stand `level` levels lower."""
    return "\n".join(_block(block, level) for block in _blocks(text))


def _blocks(text: str) -> Iterator[list[str]]:
    """Lines that belong together: headings alone, tables, lists, paragraphs."""
    block: list[str] = []
    for line in [*text.splitlines(), ""]:
        kind = _kind(line)
        if block and (kind != _kind(block[-1]) or kind == "#"):
            yield block
            block = []
        if kind:
            block.append(line.strip())


def _kind(line: str) -> str:
    start = line.strip()[:2]
    return start[:1] if start[:1] in ("#", "|") else "-" if start in ("- ", "* ") else "p" if start else ""


def _block(lines: list[str], level: int) -> str:
    kind = _kind(lines[0])
    if kind == "#" and (found := _HEADING.fullmatch(lines[0])):
        depth = min(6, len(found[1]) + level)
        return f"<h{depth}>{_inline(found[2])}</h{depth}>"
    if kind == "|":
        kept = [line for index, line in enumerate(lines) if index != 1 or not _RULE.fullmatch(line)]
        first, *rows = ([cell.strip().replace("\\|", "|") for cell in _BAR.split(line.strip("|"))] for line in kept)
        return html_of_table(first, rows)
    if kind == "-":
        return "<ul>" + "".join(f"<li>{_inline(line[2:])}</li>" for line in lines) + "</ul>"
    return f"<p>{_inline(' '.join(lines))}</p>"


def html_of_table(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Table with a line of names; numbers stand on the right."""
    first = rows[0] if rows else []
    head = "".join(_cell(name, *first[column : column + 1], kind="th") for column, name in enumerate(names))
    body = "".join(f"<tr>{''.join(_cell(text) for text in row)}</tr>" for row in rows)
    return f'<div class="table"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _cell(text: str, below: str | None = None, kind: str = "td") -> str:
    """Cell of a table; a heading stands like the cell below it."""
    right = ' class="n"' if _NUMBER.fullmatch(text if below is None else below) else ""
    return f"<{kind}{right}>{_inline(text)}</{kind}>"


def _inline(text: str) -> str:
    escaped = html.escape(text)
    escaped = re.sub(r"`([^`]+)`", r"<code>\1</code>", escaped)
    return re.sub(r"\*\*([^*]+)\*\*", r"<b>\1</b>", escaped)


def text_of(value: Any) -> str:
    """A value of JSON as the text of a cell."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(text_of(entry) for entry in value)
    if isinstance(value, dict):
        return ", ".join(f"{name} {text_of(entry)}" for name, entry in value.items())
    return "–" if value is None else str(value)
