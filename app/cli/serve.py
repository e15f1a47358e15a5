"""nerfnav serve: the browser app.

The page is up before the libraries that compute are imported, which takes longer than a browser needs to load it.
"""

import contextlib
import json
import signal
import sys
import webbrowser
from dataclasses import dataclass

from tyro.conf import Positional

from nerfnav_app.cli.served_app import end_if_computing, run_app
from nerfnav_app.cli.served_place import check, comes_along, shown_before
from nerfnav_app.page.first_sight import first_sight
from nerfnav_app.page_server import page_server
from nerfnav_app.security.address import page_url


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
    if not comes_along(arguments.place):
        check(arguments.place)  # the app would open it later, on a page that nobody may look at
    with contextlib.suppress(ValueError):  # in tests this is not the main thread, which alone hears signals
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # what supervisors send ends it as Ctrl-C does
    stdout, interrupted = sys.stdout, False
    with contextlib.redirect_stdout(sys.stderr):  # viser prints; stdout is for the address alone
        server = page_server(arguments.host, arguments.port, arguments.token)
        try:
            surface = first_sight(server, shown_before(arguments.place))
            url = page_url(arguments.host, arguments.port, arguments.token)
            told = f"nerfnav serves {arguments.place} at {url} (Ctrl-C ends it)"
            stdout.write((json.dumps({"url": url, "place": arguments.place}) if arguments.json else told) + "\n")
            stdout.flush()
            if arguments.open:
                webbrowser.open(url)
            run_app(arguments.place, arguments.host, arguments.port, arguments.token, surface)
        except KeyboardInterrupt:
            interrupted = True  # the way to end a server
        finally:
            server.stop()
    if interrupted:
        end_if_computing()
