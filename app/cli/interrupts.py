"""What Ctrl-C and a supervisor's signal do to a command."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from app.cli.terminal import note


class Stop:
    asked = False


@contextmanager
def stop_on_interrupt(enabled: bool) -> Iterator[Stop]:
    """Turn the first Ctrl-C inside the block into `asked`; the second one interrupts as usual."""
    stop = Stop()
    if not enabled:
        yield stop
        return

    def ask(_signal: int, _frame: FrameType | None) -> None:
        stop.asked = True
        signal.signal(signal.SIGINT, before)
        note("stopping, and keeping what was done so far (Ctrl-C again gives it up)")

    before = signal.signal(signal.SIGINT, ask)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)
