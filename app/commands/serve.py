"""nerfnav serve: the browser app."""

import contextlib
import sys
from dataclasses import dataclass

from tyro.conf import Positional

from app.commands.screen import show
from app.net import check_address
from app.place import field_file
from app.server import serve
from nerfnav.field.checkpoint import load_field


@dataclass(frozen=True)
class Arguments:
    """Open a scene or a field in the browser, until Ctrl-C."""

    place: Positional[str] = "stonehenge"
    """Name of a bundled scene, or path of a field file."""
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
    load_field(field_file(arguments.place))  # the app would open it later, on a page that nobody may look at
    check_address(arguments.host, arguments.port)
    stdout = sys.stdout

    def announce(url: str) -> None:
        with contextlib.redirect_stdout(stdout):
            if arguments.json:
                show("serve", {"url": url, "place": arguments.place}, as_json=True)
            else:
                stdout.write(f"nerfnav serves {arguments.place} at {url} (Ctrl-C ends it)\n")
            stdout.flush()

    with contextlib.redirect_stdout(sys.stderr):  # viser prints; stdout is for the address alone
        serve(arguments.place, arguments.host, arguments.port, arguments.token, arguments.open, announce)
