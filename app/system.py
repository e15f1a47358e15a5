"""The process: its threads, its memory, importing much at once, and a second one that compiles kernels."""

import ctypes
import gc
import os
import subprocess
import sys
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


@contextmanager
def compiling_kernels() -> Iterator[None]:
    """Compile the kernels of plans and flights in another process inside the block, unless this machine has them.

    With one core there is no such process, for it would only take the place of this one; nor where the machine code
    cannot be kept.
    """
    from nerfnav.core.jit import count_cores
    from nerfnav.core.kernel_cache import can_be_kept, complete_mark

    if count_cores() < 2 or complete_mark().exists() or not can_be_kept():
        yield
        return
    # -P: nothing is imported from the folder that the user is in
    command = [sys.executable, "-P", "-m", "nerfnav_app.kernels_ahead"]
    # a session of its own: Ctrl-C is for this process, which then ends that one
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)
    try:
        yield
    finally:
        process.terminate()
        process.wait()
