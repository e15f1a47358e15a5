"""Icons for many widgets at once: viser lists an archive of thousands anew for each icon that it has not shown yet."""

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

from viser import _icons


@contextmanager
def icons_at_hand() -> Iterator[None]:
    """Let widgets that are made inside the block take their icons out of one open archive."""
    with zipfile.ZipFile(_icons.ICONS_DIR / "tabler-icons.zip") as archive:
        _icons.zipfile = SimpleNamespace(ZipFile=lambda _: nullcontext(archive))  # type: ignore[assignment]
        try:
            yield
        finally:
            _icons.zipfile = zipfile  # type: ignore[attr-defined]
