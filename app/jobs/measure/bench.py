"""What a bench compares, and what a quick one asks."""

import importlib
import importlib.util
from collections.abc import Callable
from types import ModuleType
from typing import Any

MEASURES = ("plan", "replan", "filter", "render", "train_step")
"""What is compared: each is a module of nerfnav_app.benchmarks with a function `measure`."""
QUICK: dict[str, dict[str, Any]] = {
    "plan": {"tasks": 2, "fast_per_round": 3},
    "replan": {"tasks": 2, "rounds": 1},
    "render": {"pictures": 1, "size": 60},
    "train_step": {"rays": 256, "rounds": 1},
    "busy": {"tasks": 1, "rounds": 1},
    "cold": {"rounds": 1},
    "scaling": {"repeats": 10, "tasks": 2},
}
"""What a quick bench asks of each measure, in place of its own defaults."""
Finder = Callable[[str], ModuleType | None]


def module_named(name: str) -> ModuleType | None:
    """The module of one measure; None where this version has none."""
    full = f"nerfnav_app.benchmarks.{name}"
    return None if importlib.util.find_spec(full) is None else importlib.import_module(full)
