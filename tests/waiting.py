"""Waiting in tests: for a condition, with patience for a busy machine; and free ports."""

import os
import random
import socket
import time
from collections.abc import Callable
from typing import Any

PATIENCE_S = 180.0
"""Limit for anything that takes a moment on an idle machine [s]."""
_WORKERS = 16
_WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:]) % _WORKERS
_PORTS = range(20_000, 32_000)[_WORKER::_WORKERS]  # below those that connections of this machine are given
"""Ports of this process: no other test can take one between the search and its use."""


def until(condition: Callable[[], Any], complaint: str, timeout_s: float = PATIENCE_S) -> None:
    """Wait until `condition` holds; fail with `complaint` when it does not in time."""
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end, complaint
        time.sleep(0.01)


def free_port() -> int:
    """Return a port of this machine that is free now, and that no outgoing connection takes in the meantime."""
    for port in random.sample(_PORTS, 100):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
    raise AssertionError(f"no free port from {_PORTS.start} to {_PORTS.stop - 1}")
