"""Importing much at once, such as torch, without what only takes time then."""

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager


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
