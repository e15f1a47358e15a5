"""nerfnav serve: the browser app.

The page is up before the libraries that compute are imported, which takes longer than a browser needs to load it: so
nothing slow is imported here at the top. The place is checked and shown from what this machine has kept of it; then
the app is brought to the page that is already up.
"""

import contextlib
import importlib.util
import json
import os
import signal
import sys
import threading
import webbrowser
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from nerfnav_app.page.layers.field_surface import FieldSurfaceLayer
from nerfnav_app.page.splash import show_splash
from nerfnav_app.page_server import page_server
from nerfnav_app.places.kept_surface import kept_surface
from nerfnav_app.security.address import page_url
from nerfnav_app.system import compiling_kernels, importing


def shown_before(place: str) -> bytes | None:
    """Read the surface of a field that this machine has shown before."""
    file = _bundled(place) if comes_along(place) else Path(place)
    return (kept_surface(file) or None) if file.is_file() else None


def comes_along(place: str) -> bool:
    """Check for a bundled scene with its field."""
    return place.isidentifier() and _bundled(place).is_file()


def _bundled(scene: str) -> Path:
    """Path of the field of a bundled scene, without importing the scenes."""
    spec = importlib.util.find_spec("nerfnav_scenes")
    assert spec is not None and spec.origin is not None, "scenes are a part of nerfnav"
    return Path(spec.origin).parent / "trained" / f"{scene}.npz"


def check(place: str) -> None:
    """Raise NerfnavError where there is no such scene or file, or it is nothing that can be opened."""
    import nerfnav_scenes as scenes
    from nerfnav.field import load_field
    from nerfnav.importers import source_kind
    from nerfnav_app.places.place import field_file

    if source_kind(place, scenes.names()).command is None:
        load_field(field_file(place))


def check_obstacles(file: Path) -> None:
    """Raise NerfnavError where a file of obstacles cannot be read."""
    from nerfnav.obstacles import read_obstacles

    read_obstacles(file)


_SWITCH_S = 0.001
"""Longest time that the worker keeps the interpreter from the page; a click needs it several times."""


def run_app(
    what: str, host: str, port: int, token: str | None, surface: FieldSurfaceLayer, obstacles: Path | None
) -> None:
    """Bring the app to the page, which shows the place already where it was shown before, and wait for its end."""
    with importing(for_good=True):
        from nerfnav_app.server import App

    sys.setswitchinterval(_SWITCH_S)
    app = App(what, host, port, token, begun=surface, remembers=True, obstacles=obstacles)
    try:
        app.start()  # Ctrl-C may come while the page is put up: its threads end before the server either way
        with compiling_kernels():
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


@dataclass(frozen=True)
class Arguments:
    """Open a scene or a field in the browser, until Ctrl-C."""

    place: Positional[str] = "stonehenge"
    """Bundled scene, or path of a field, mesh, capture, video, trained NeRF or splats. All but fields become a field
    first, beside the file."""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """Address to listen at; the default is for this machine alone."""
    port: int = 8080
    """Port to listen at."""
    token: Annotated[str | None, arg(metavar="SECRET")] = None
    """Secret of the visitors, as in http://HOST:PORT/?token=SECRET."""
    obstacles: Annotated[Path | None, arg(metavar="FILE")] = None
    """Obstacles in the place, in YAML or JSON; the page can move them."""
    open: bool = False
    """Open the page in this machine's browser."""
    json: bool = False
    """Print one JSON object with the address."""


def run(arguments: Arguments) -> None:
    """Check what can be checked at once, serve, print the address."""
    if not comes_along(arguments.place):
        check(arguments.place)  # the app would open it later, on a page that may have no visitor
    if arguments.obstacles is not None:
        check_obstacles(arguments.obstacles)
    with contextlib.suppress(ValueError):  # in tests this is not the main thread, which alone hears signals
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # what supervisors send ends it as Ctrl-C does
    stdout, interrupted = sys.stdout, False
    with contextlib.redirect_stdout(sys.stderr):  # viser prints; stdout is for the address alone
        server = page_server(arguments.host, arguments.port, arguments.token)
        try:
            surface = show_splash(server, shown_before(arguments.place))
            url = page_url(arguments.host, arguments.port, arguments.token)
            text = f"nerfnav serves {arguments.place} at {url} (Ctrl-C ends it)"
            stdout.write((json.dumps({"url": url, "place": arguments.place}) if arguments.json else text) + "\n")
            stdout.flush()
            if arguments.open:
                webbrowser.open(url)
            run_app(
                arguments.place, arguments.host, arguments.port, arguments.token, surface, arguments.obstacles
            )
        except KeyboardInterrupt:
            interrupted = True  # the way to end a server
        finally:
            server.stop()
    if interrupted:
        end_if_computing()
