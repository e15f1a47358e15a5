"""A viser server that lets in only whom it should, and takes from them only what the page can send.

viser has no authentication, checks no Origin (any web page could drive a local server), lets every tab open a public
tunnel, lets a tab set any attribute of a widget, and keeps and replays whatever numbers a tab sends. All of this is
closed here, from outside: it leans on inner names of viser, whose version is therefore bounded in pyproject.toml.

    access           who may ask for anything: token, Host, Origin, how often
    message_filter   what a connection may send: how much, which messages, with sane contents
    widget_values    what a widget may be set to
    upload_limits    which uploads are taken
    token_bucket     how much of something may happen
    token            the secret that visitors bring
    websocket_guard  how the server comes to ask them
    address          whether a server can listen at an address
"""

import contextlib
import io
import logging
from collections.abc import Callable
from dataclasses import dataclass

import viser

from nerfnav.core.errors import NerfnavError
from nerfnav_app.security.access import AccessPolicy
from nerfnav_app.security.message_filter import MessageFilter
from nerfnav_app.security.token import check_token
from nerfnav_app.security.upload_limits import limit_uploads
from nerfnav_app.security.websocket_guard import guarding


@dataclass(frozen=True)
class PagePolicy:
    """What the guard has to know of the page."""

    brand: Callable[[bytes], bytes]
    """viser's page (HTML) to the same under the app's name."""
    most_upload_bytes: int
    """Largest file that is taken [bytes]."""


def guarded_server(host: str, port: int, token: str | None, policy: PagePolicy) -> viser.ViserServer:
    """A viser server at `host`:`port` behind a guard; hosts that other machines reach must have a token.

    Raises TokenError for a missing or unusable token, NerfnavError where the port was taken meanwhile.
    """
    check_token(host, token)
    message_filter = MessageFilter()
    logging.getLogger("websockets.server").addFilter(_is_worth_telling)
    access = AccessPolicy(host, token, policy.brand)
    with guarding(access, message_filter), contextlib.redirect_stdout(io.StringIO()):  # it prints a banner
        server = viser.ViserServer(host=host, port=port, verbose=False)
    if server.get_port() != port:  # another process took the port after it was checked
        server.stop()
        raise NerfnavError(f"port {port} of {host} was taken a moment ago: choose another with --port")
    limit_uploads(server, policy.most_upload_bytes)
    message_filter.open(server)
    return server


def _is_worth_telling(record: logging.LogRecord) -> bool:
    """Drops the tracebacks of whoever leaves before asking; viser does so itself, but only after the first request."""
    return record.getMessage() != "opening handshake failed"
