"""A viser server that lets in only whom it should, and takes from them only what the page can send.

viser has no authentication, checks no Origin (any web page could drive a local server), lets every tab open a public
tunnel, lets a tab set any attribute of a widget, and keeps and replays whatever numbers a tab sends. All of this is
closed here, from outside: it leans on inner names of viser, whose version is therefore bounded in pyproject.toml.

    access           who may ask for anything: token, Host, Origin, how often
    message_filter   what a connection may send: how much, which messages, with sane contents
    widget_values    what a widget may be set to
    upload_limits    which uploads are taken
    token_bucket     how much of something may happen
    address          whether a server can listen at an address
"""

import contextlib
import io
import logging
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import viser
import websockets.asyncio.server
from websockets.http11 import Request, Response

from app.security.access import AccessPolicy
from app.security.address import is_loopback
from app.security.message_filter import LARGEST_FRAME, MOST_WAITING, MessageFilter
from app.security.upload_limits import limit_uploads
from nerfnav.errors import NerfnavError

_patching = threading.Lock()

Responder = Callable[[Any, Request], Response | None]


class TokenError(NerfnavError):
    """A server that others can reach would have no token."""


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
    if token is None and not is_loopback(host):
        raise TokenError(
            f"whoever reaches {host} could steer this app: give it a secret with --token, or serve at 127.0.0.1"
        )
    if token is not None and not re.fullmatch(r"[A-Za-z0-9._~-]+", token):
        raise TokenError("a token is made of letters, digits, '.', '_', '~' and '-', for it travels in addresses")
    message_filter = MessageFilter()
    logging.getLogger("websockets.server").addFilter(_is_worth_telling)
    access = AccessPolicy(host, token, policy.brand)
    with _guarding(access, message_filter), contextlib.redirect_stdout(io.StringIO()):  # it prints a banner
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


@contextmanager
def _guarding(access: AccessPolicy, message_filter: MessageFilter) -> Iterator[None]:
    """While open, servers of `websockets` are built behind `access` and `message_filter`."""
    build = websockets.asyncio.server.serve

    def build_guarded(handler: Any, *args: Any, process_request: Responder, **options: Any) -> Any:
        def respond(connection: Any, request: Request) -> Response | None:
            refusal = access.refusal(request)
            return refusal if refusal is not None else access.welcome(request, process_request(connection, request))

        options |= {"max_size": LARGEST_FRAME, "max_queue": MOST_WAITING}
        return build(message_filter.before(handler), *args, process_request=respond, **options)

    with _patching:
        websockets.asyncio.server.serve = build_guarded  # type: ignore[assignment]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = build
