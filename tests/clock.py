"""Clock that moves where slow work says so: tests of budgets of time do not depend on the machine."""

import time
from collections.abc import Callable
from typing import Any

import pytest


class Clock:
    """Stand-in for `time.perf_counter`, which moves where it is told to."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self._monkeypatch = 0.0, monkeypatch
        monkeypatch.setattr(time, "perf_counter", lambda: self.now)

    def slow(self, owner: Any, name: str, seconds: Callable[..., float]) -> None:
        """Let a function of `owner` take so many seconds, by its arguments."""
        work = getattr(owner, name)

        def slowed(*arguments: Any, **named: Any) -> Any:
            self.now += seconds(*arguments)
            return work(*arguments, **named)

        self._monkeypatch.setattr(owner, name, slowed)
