"""The app, brought to a page that is up already."""

import os
import sys
import threading

from nerfnav_app.page.layers.field_surface import FieldSurfaceLayer
from nerfnav_app.system import importing

_SWITCH_S = 0.001
"""How long the worker may keep the interpreter when the page wants it; a click needs it several times."""


def run_app(what: str, host: str, port: int, token: str | None, surface: FieldSurfaceLayer) -> None:
    """Bring the app to the page, which shows the place already where it was shown before, and wait for its end."""
    with importing(for_good=True):
        from nerfnav_app.server import App

    sys.setswitchinterval(_SWITCH_S)
    app = App(what, host, port, token, begun=surface, remembers=True)
    app.start()
    try:
        app.wait()
    finally:
        app.stop()


def end_if_computing() -> None:
    """End the process at once where a thread of the app is in the middle of a long step, which was waited for enough.

    Torch aborts where the interpreter is taken down under it.
    """
    if any(thread.name.startswith("nerfnav-") for thread in threading.enumerate()):
        sys.stderr.flush()
        os._exit(0)
