"""Token bucket: a rate limit of so much at once, and so much each second."""

import time
from collections.abc import Callable


class TokenBucket:
    """Fills with time, is emptied by what happens."""

    def __init__(self, most: float, per_s: float, now: Callable[[], float] = time.monotonic) -> None:
        """Full at first; `most` is what it holds, `per_s` what it gains each second, `now` a clock [s]."""
        self._most, self._per_s, self._now = most, per_s, now
        self._left, self._at = most, now()

    def spend(self, amount: float) -> bool:
        """Take `amount` if it is there; whether it was."""
        now = self._now()
        self._left = min(self._most, self._left + (now - self._at) * self._per_s)
        self._at = now
        if amount > self._left:
            return False
        self._left -= amount
        return True
