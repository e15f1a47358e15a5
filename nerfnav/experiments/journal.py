"""Checkpoint of an experiment: the answers of trials that are done, so that one that was interrupted goes on there."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Journal:
    """A file with a line of JSON for each trial that is done."""

    path: Path
    """The file; made with the first answer."""
    about: str
    """What else the answers depend on: those that were noted about something else do not count."""

    def answers(self, items: Sequence[Any]) -> dict[int, Any]:
        """What was answered already, by index of the item; a line that was not written to its end does not count."""
        if not self.path.exists():
            return {}
        noted = {}
        for line in self.path.read_text().splitlines():
            try:
                key, answer = json.loads(line)
            except ValueError:
                continue
            noted[key] = answer
        keys = [self._key(index, item) for index, item in enumerate(items)]
        return {index: noted[key] for index, key in enumerate(keys) if key in noted}

    def add(self, index: int, item: Any, answer: Any) -> None:
        """Note an answer: plain numbers, words, lists and tables of them."""
        with self.path.open("a") as stream:
            stream.write("\n" + json.dumps([self._key(index, item), answer]) + "\n")

    def _key(self, index: int, item: Any) -> str:
        return f"{self.about}: {index} {item!r}"
