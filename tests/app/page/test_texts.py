"""Texts of the page against one golden file, so that a change of wording shows in one diff.

    python -m tests.app.page.test_texts      # writes texts.json again

It holds the label and hint of each widget by its name, the commands of the palette, and all other texts of two words or
more in the code of page, reducers and state; `{}` stands for a value.
"""

import ast
import json
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import viser

from nerfnav_app.page.layers.field_surface import FieldSurfaceLayer
from nerfnav_app.page.page import build_page
from nerfnav_app.page.panels.status.command_palette import entries
from nerfnav_app.places.library import PlaceLibrary
from tests.app.page.handles import named_handles

ROOT = Path(__file__).parents[3]
GOLDEN = Path(__file__).with_name("texts.json")
_ROOMS = ("page", "reducers", "state")
_REGISTERED = ("Open ", "Planner: ", "Robot: ")
"""Beginnings of commands that come from registries."""
_SENTENCE = re.compile(r"[A-Za-z]{3,}.* | .*[A-Za-z]{3,}")
_MARKUP = re.compile(r"[<>]|px|em;|: var|light-dark|//")


def widgets(folder: Path) -> dict[str, list[str]]:
    """Build the page, and read labels, hints and buttons of its widgets by name."""
    server = viser.ViserServer(port=0, verbose=False)
    try:
        parts = build_page(FieldSurfaceLayer(server), lambda command: None, PlaceLibrary(folder))
        return {name: texts for name, handle in named_handles(parts).items() if (texts := _texts_of(handle))}
    finally:
        server.stop()


def _texts_of(handle: Any) -> list[str]:
    found = [getattr(handle, name, None) for name in ("label", "hint")]
    if isinstance(handle, viser.GuiButtonGroupHandle):
        found += handle.options
    return [text for text in found if text]


def commands() -> dict[str, str]:
    """List the commands of the palette that are no registry's, with their hints."""
    return {entry.label: entry.hint or "" for entry in entries() if not entry.label.startswith(_REGISTERED)}


def sentences() -> dict[str, list[str]]:
    """List the sentences in the code, by module."""
    files = sorted(path for room in _ROOMS for path in (ROOT / "app" / room).rglob("*.py"))
    found = {path.relative_to(ROOT).as_posix(): _sentences_in(ast.parse(path.read_text())) for path in files}
    return {name: texts for name, texts in found.items() if texts}


def _sentences_in(tree: ast.Module) -> list[str]:
    return list(dict.fromkeys(text for text in _strings(tree) if _SENTENCE.search(text) and not _MARKUP.search(text)))


def _strings(node: ast.AST) -> Iterator[str]:
    """Strings in the order of the code, without docstrings, annotations and the messages of assertions."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        yield "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)
        for part in node.values:
            if isinstance(part, ast.FormattedValue):
                yield from _strings(part.value)
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return
    elif not isinstance(node, ast.Assert):
        for child in ast.iter_child_nodes(node):
            yield from _strings(child)


def texts(folder: Path) -> dict[str, Any]:
    """Collect all texts of the page."""
    named, palette = widgets(folder), commands()
    listed = {*palette, *palette.values(), *(text for group in named.values() for text in group)}
    others = {name: [text for text in found if text not in listed] for name, found in sentences().items()}
    return {
        "widgets": named,
        "commands": palette,
        "sentences": {name: found for name, found in others.items() if found},
    }


def test_the_texts_of_the_page_are_those_of_the_golden_file(tmp_path: Path) -> None:
    assert texts(tmp_path) == json.loads(GOLDEN.read_text())


def test_every_widget_has_a_name(tmp_path: Path) -> None:
    server = viser.ViserServer(port=0, verbose=False)
    try:
        parts = build_page(FieldSurfaceLayer(server), lambda command: None, PlaceLibrary(tmp_path))
        named = {id(handle) for handle in named_handles(parts).values()}
        made = server.gui._gui_input_handle_from_uuid.values()
        assert [handle.label for handle in made if id(handle) not in named] == []
    finally:
        server.stop()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        GOLDEN.write_text(json.dumps(texts(Path(made)), indent=1, ensure_ascii=False) + "\n")
