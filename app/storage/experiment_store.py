"""Store of experiments: names, lists and reads the folders in runs/experiments to which experiments write results."""

import json
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from nerfnav_app.storage.output_files import prepare_folder
from nerfnav_app.storage.run_store import checked
from nerfnav_app.text import number

FOLDER = "experiments"
"""Within the folder of runs."""
_RESULTS = "results.json"
_MOST_FIGURES = 4


@dataclass(frozen=True)
class ExperimentResult:
    """Results of an experiment."""

    name: str
    """Of its folder."""
    numbers: tuple[tuple[str, str], ...]
    """Its summary, as names and values."""
    figures: tuple[np.ndarray, ...] = field(compare=False)
    """(height, width, 3), sRGB bytes."""


class ExperimentStore:
    """Store of the results of experiments."""

    def __init__(self, runs: Path) -> None:
        """`runs` is the folder of runs."""
        self.folder = runs / FOLDER

    def new(self, name: str) -> Path:
        """The folder for the results of an experiment that begins now, made as the job writes into it."""
        prepare_folder(self.folder)
        return self.folder / f"{datetime.now(UTC):%Y-%m-%d-%H%M%S}-{checked(name)}"

    def names(self) -> tuple[str, ...]:
        """All folders with results, the newest first."""
        try:
            found = [path.parent.name for path in self.folder.glob(f"*/{_RESULTS}")]
        except OSError:
            return ()
        return tuple(sorted(found, reverse=True))

    def result(self, name: str) -> ExperimentResult | None:
        """The results in a folder; None where there are none that can be read."""
        if name not in self.names():
            return None
        folder = self.folder / name
        try:
            summary = json.loads((folder / _RESULTS).read_text())["summary"]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        pictures = [cv2.imread(str(path)) for path in sorted(folder.glob("*.png"))[:_MOST_FIGURES]]
        figures = tuple(np.ascontiguousarray(picture[..., ::-1]) for picture in pictures if picture is not None)
        return ExperimentResult(name, tuple(lines(summary)), figures)


def lines(summary: Any, before: str = "") -> list[tuple[str, str]]:
    """A summary as flat lines: `a.b` for what is nested."""
    if isinstance(summary, dict):
        return [line for name, value in summary.items() for line in lines(value, f"{before}{name}.")]
    name = before.removesuffix(".").replace("_", " ")
    if isinstance(summary, bool) or summary is None:
        return [(name, {True: "yes", False: "no", None: "–"}[summary])]
    if isinstance(summary, int | float):
        return [(name, number(summary, ""))]
    if isinstance(summary, list):
        return [(name, ", ".join(number(entry, "") if isinstance(entry, float) else str(entry) for entry in summary))]
    return [(name, str(summary))]
