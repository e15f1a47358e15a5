"""Named handles: the widgets of a page by panel and attribute, such as `flight.gust`, whatever their labels are."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

import viser
from viser._gui_handles import _GuiHandle

from nerfnav_app.state.robot_draft import RobotNumber

_CONTAINERS = ("button", "buttons")
"""Attributes that add nothing to a name."""


def named_handles(parts: Iterable[Any]) -> dict[str, Any]:
    """Map names to the handles of all parts of a page: the panel's class, then attributes and keys."""
    return {
        name: handle
        for part in parts
        for name, handle in _handles_in(_snake(type(part).__name__.removesuffix("Panel")), part)
    }


@dataclass(frozen=True)
class Position:
    """Tab and folder of a widget, by their titles; None where it is in none."""

    tab: str | None = None
    folder: str | None = None


def position_of(handle: Any) -> Position:
    """Find the tab and the innermost folder of a widget."""
    gui, container, folder = handle._impl.gui_api, handle._impl.parent_container_id, None
    while container != "root":
        parent = gui._container_handle_from_uuid[container]
        if isinstance(parent, viser.GuiTabHandle):
            return Position(parent._label, folder)
        folder = folder or parent.label
        container = parent._impl.parent_container_id
    return Position(None, folder)


def _handles_in(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, _GuiHandle):
        yield name, value
    elif isinstance(value, Mapping):
        for key, entry in value.items():
            yield from _handles_in(f"{name}.{_key(key)}", entry)
    elif isinstance(value, list | tuple):
        for index, entry in enumerate(value):
            yield from _handles_in(f"{name}.{index}", entry)
    elif type(value).__module__.startswith("nerfnav_app.page") and hasattr(value, "__dict__"):
        for attribute, entry in vars(value).items():
            short = attribute.lstrip("_")
            yield from _handles_in(name if short in _CONTAINERS else f"{name}.{short}", entry)


def _key(key: Any) -> str:
    if isinstance(key, RobotNumber):
        return f"{key.part}.{key.name}" if key.part else key.name
    if isinstance(key, type):
        return _snake(key.__name__)
    return key.name.lower() if isinstance(key, Enum) else str(key).lower().replace(" ", "_")


def _snake(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
