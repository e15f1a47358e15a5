"""Page of a report: HTML, style and pictures in one file that needs no network.

Replays are pages of their own in frames without rights (sandbox): each begins as it is opened, because browsers draw
only a few at the same time.
"""

import html
from collections.abc import Sequence
from dataclasses import dataclass, field

_STYLE = """
  :root { color-scheme: light dark; --text: light-dark(#1b1e28, #e6e8ee); --muted: light-dark(#5a6070, #9aa0ae);
    --line: light-dark(#d9dce4, #2f3340); --card: light-dark(#f6f7fa, #1a1c24); --page: light-dark(#fff, #11131a); }
  body { margin: 0 auto; padding: 24px; max-width: 1120px; background: var(--page); color: var(--text);
    font: 15px/1.5 system-ui, sans-serif; }
  h1 { margin: 0 0 8px; } h2 { margin: 48px 0 8px; border-top: 1px solid var(--line); padding-top: 24px; }
  h3, h4 { margin: 24px 0 8px; }
  nav a { margin-right: 1em; white-space: nowrap; } a { color: light-dark(#4a34d8, #a99bff); }
  .muted { color: var(--muted); font-size: 13px; }
  .table { overflow: auto; max-height: 75vh; margin: 8px 0 16px; }
  table { border-collapse: collapse; font-size: 13px; }
  th, td { padding: 3px 10px; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
  td:first-child { min-width: 8em; }
  th { position: sticky; top: 0; background: var(--card); }
  .n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
  figure { margin: 16px 0; } figure img { max-width: 100%; background: white; border-radius: 6px; }
  figcaption, summary { color: var(--muted); font-size: 13px; } summary { cursor: pointer; padding: 6px 0; }
  iframe { width: 100%; height: 560px; border: 0; border-radius: 8px; background: #0d0f15; }
  @media print { iframe, details { display: none; } .table { overflow: visible; max-height: none; }
    th { position: static; } }
"""


@dataclass(frozen=True)
class Section:
    """Part of a page: one experiment."""

    name: str
    """Name of the experiment."""
    body: str
    """Its tables, as HTML."""
    figures: dict[str, str] = field(default_factory=dict)
    """Name to data URL."""
    replays: dict[str, str] = field(default_factory=dict)
    """Name to page."""
    rows: str = ""
    """Table of its trials, as HTML; empty without one."""


def page_of(title: str, sections: Sequence[Section]) -> str:
    """Write the page of a folder."""
    links = [f'<a href="#s{index}">{html.escape(section.name)}</a>' for index, section in enumerate(sections)]
    contents = f"<nav>{' '.join(links)}</nav>" if len(links) > 1 else ""
    body = "\n".join(_section(f"s{index}", section) for index, section in enumerate(sections))
    name = html.escape(title)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n<link rel="icon" href="data:,">\n'
        f"<title>{name}: nerfnav report</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        f"<h1>{name}</h1>\n{contents}\n{body}\n</body>\n</html>\n"
    )


def _section(anchor: str, section: Section) -> str:
    figures = [
        f'<figure><img src="{url}" alt="{html.escape(name)}"><figcaption>{_words(name)}</figcaption></figure>'
        for name, url in section.figures.items()
    ]
    replays = [
        f"<details{' open' if index == 0 else ''}><summary>Flight: {_words(name)}</summary>"
        f'<iframe sandbox="allow-scripts" loading="lazy" title="{html.escape(name)}" srcdoc="{html.escape(page)}">'
        "</iframe></details>"
        for index, (name, page) in enumerate(section.replays.items())
    ]
    rows = f"<details><summary>All trials</summary>{section.rows}</details>" if section.rows else ""
    return "\n".join((f'<section id="{anchor}">', section.body, *figures, *replays, rows, "</section>"))


def _words(name: str) -> str:
    return html.escape(name.replace("_", " "))
