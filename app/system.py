"""The process: its threads, its memory, and importing much at once."""

import ctypes
import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager

TORCH_THREADS = 1
"""Threads of torch in processes that run jobs.

Planner and filter are many small operations: more threads are no faster, and burn the cores. The large work runs in
compiled kernels, which have threads of their own.
"""


def use_one_blas_thread() -> None:
    """Let numpy's OpenBLAS use one thread, unless OPENBLAS_NUM_THREADS says otherwise; call it before numpy is loaded.

    Plans and flights then are equal whatever the number of cores: with two threads it sums in another order, and the
    plan of a flight came out 15 mm elsewhere.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@contextmanager
def importing(for_good: bool = False) -> Iterator[None]:
    """Import inside the block in two thirds of the time.

    Nothing of it is garbage, so no garbage is looked for meanwhile. Torch asks no other package whether it brings a
    device, which takes a sixth of a second; who has such a one sets TORCH_DEVICE_BACKEND_AUTOLOAD=1.

    `for_good` also exempts all that exists at its end from later collections, which would otherwise hold a server up
    for a tenth of a second each: for processes that do nothing else from then on.
    """
    os.environ.setdefault("TORCH_DEVICE_BACKEND_AUTOLOAD", "0")
    gc.disable()
    try:
        yield
        if for_good:
            gc.freeze()
    finally:
        gc.enable()


def give_back() -> None:
    """Return free memory to the machine, in some 20 ms; does nothing where the C library knows no such thing.

    That of GNU keeps what was freed between pieces that are still in use, some hundred megabytes after many flights.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
