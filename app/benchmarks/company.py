"""Company for what is timed: processes that compute without end, and the cores that all of them share."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

PROCESSES = 2
"""Busy processes."""
_SETTLE_S = 0.3
"""Time for which they start up before anything is timed beside them [s]."""


@contextmanager
def company() -> Iterator[None]:
    """Processes that compute as long as the block lasts, on the cores of this one."""
    with ExitStack() as stack:
        for _ in range(PROCESSES):
            other = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(other.wait)
            stack.callback(other.kill)
        time.sleep(_SETTLE_S)
        yield


@contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Keep this process, and those that it starts, on so many cores, where the system can do that."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:count])
    try:
        yield
    finally:
        with suppress(OSError):  # a core may have been taken away meanwhile
            os.sched_setaffinity(0, before)
