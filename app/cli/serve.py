"""nerfnav serve: the browser app.

The page is up before the libraries that compute are imported, which takes longer than a browser needs to load it.
"""

import contextlib
import importlib.util
import json
import signal
import sys
import threading
import webbrowser
from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from app.page.html import heading
from app.page.layers.field_surface import FieldSurfaceLayer
from app.page.theme import apply_theme
from app.page_server import page_server
from app.places.surface_glb import kept_surface
from app.security.address import check_address, page_url
from app.system.fast_imports import importing

_SWITCH_S = 0.001
"""How long the worker may keep the interpreter when the page wants it; a click needs it several times."""


@dataclass(frozen=True)
class Arguments:
    """Open a scene or a field in the browser, until Ctrl-C."""

    place: Positional[str] = "stonehenge"
    """Name of a bundled scene, or path of anything that can be opened: a field, a mesh, a capture, splats, a video, a
    trained NeRF. A field is made of it first, beside it, where it is none."""
    host: str = "127.0.0.1"
    """Address to listen at; the default is reached from this machine alone."""
    port: int = 8080
    """Port to listen at."""
    token: str | None = None
    """Secret that visitors must bring, as in http://HOST:PORT/?token=T."""
    open: bool = False
    """Open the page in this machine's browser."""
    json: bool = False
    """Print one JSON object with the address."""


def run(arguments: Arguments) -> None:
    """Check what can be checked at once, serve, tell the address."""
    if not _comes_along(arguments.place):
        _check(arguments.place)  # the app would open it later, on a page that nobody may look at
    check_address(arguments.host, arguments.port)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # what supervisors send ends it as Ctrl-C does
    stdout = sys.stdout
    with contextlib.redirect_stdout(sys.stderr):  # viser prints; stdout is for the address alone
        server = page_server(arguments.host, arguments.port, arguments.token)
        try:
            apply_theme(server)
            server.gui.add_html(heading("nerfnav", "Starting…"))
            scene = FieldSurfaceLayer(server, _shown_before(arguments.place))
            url = page_url(arguments.host, arguments.port, arguments.token)
            told = f"nerfnav serves {arguments.place} at {url} (Ctrl-C ends it)"
            stdout.write((json.dumps({"url": url, "place": arguments.place}) if arguments.json else told) + "\n")
            stdout.flush()
            if arguments.open:
                webbrowser.open(url)
            _run_app(arguments, scene)
        except KeyboardInterrupt:
            return  # the way to end a server
        finally:
            server.stop()


def _run_app(arguments: Arguments, scene: FieldSurfaceLayer) -> None:
    """Bring the app to the page, which shows the place already where it was shown before, and wait for its end."""
    with importing(for_good=True):
        from app.server import App

    sys.setswitchinterval(_SWITCH_S)
    app = App(arguments.place, arguments.host, arguments.port, arguments.token, begun=scene)
    app.start()
    try:
        app.wait()
    finally:
        app.stop()


def _shown_before(place: str) -> bytes | None:
    """The surface of a field that this machine has shown before."""
    file = _bundled(place) if _comes_along(place) else Path(place)
    return kept_surface(file) if file.is_file() else None


def _comes_along(place: str) -> bool:
    """Whether it is a bundled scene with its field."""
    return place.isidentifier() and _bundled(place).is_file()


def _bundled(scene: str) -> Path:
    """Where the field of a bundled scene would be, found without importing what knows scenes."""
    spec = importlib.util.find_spec("scenes")
    assert spec is not None and spec.origin is not None, "scenes are a part of nerfnav"
    return Path(spec.origin).parent / "trained" / f"{scene}.npz"


def _check(place: str) -> None:
    """Raise NerfnavError where there is no such scene or file, or it is nothing that can be opened."""
    import scenes
    from app.places.opening import field_file
    from nerfnav.field.checkpoint import load_field
    from nerfnav.importers.kind import source_kind

    if source_kind(place, scenes.names()).command is None:
        load_field(field_file(place))
