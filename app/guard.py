"""A viser server that lets in only whom it should.

viser has no authentication, checks no Origin (any web page could drive a local server), lets every tab open a public
tunnel, and lets a tab set any attribute of a widget. All of this is closed here, from outside: it leans on inner names
of viser, whose version is therefore bounded in pyproject.toml.

    token: `/?token=T` sets a cookie; without it, or with a wrong one, there is neither page nor connection
    Host and Origin: only names of this server, so that no page of another site can talk to it (DNS rebinding included)
"""

import contextlib
import gzip
import hmac
import http
import io
import ipaddress
import re
import threading
from collections.abc import Callable
from contextlib import contextmanager
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

import viser
import viser._messages as viser_messages
import websockets.asyncio.server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from app.net import is_loopback
from app.theme import HIT, branded
from app.uploads import MOST_BYTES
from nerfnav.errors import NerfnavError

_COOKIE = "nerfnav_token"
_UPLOADS_AT_ONCE = 4
_patching = threading.Lock()

Responder = Callable[[Any, Request], Response | None]


class TokenError(NerfnavError):
    """A server that others can reach would have no token."""


def guarded_server(host: str, port: int, token: str | None) -> viser.ViserServer:
    """A viser server at `host`:`port` behind a guard; hosts that other machines reach must have a token."""
    if token is None and not is_loopback(host):
        raise TokenError(
            f"whoever reaches {host} could steer this app: give it a secret with --token, or serve at 127.0.0.1"
        )
    if token is not None and not re.fullmatch(r"[A-Za-z0-9._~-]+", token):
        raise TokenError("a token is made of letters, digits, '.', '_', '~' and '-', for it travels in addresses")
    with _guarding(Guard(host, token)), contextlib.redirect_stdout(io.StringIO()):  # it prints a banner
        server = viser.ViserServer(host=host, port=port, verbose=False)
    if server.get_port() != port:  # somebody took the port after it was checked
        server.stop()
        raise NerfnavError(f"port {port} of {host} was taken a moment ago: choose another with --port")
    for message in (viser_messages.ShareUrlRequest, viser_messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(message)
    _admit_values_only(server)
    _limit_uploads(server)
    return server


class Guard:
    """Decides on each request before viser sees it."""

    def __init__(self, host: str, token: str | None) -> None:
        """`host` is what the server listens at."""
        self._local = is_loopback(host)
        self._token = token
        self._pages: dict[bool, bytes] = {}

    def refusal(self, request: Request) -> Response | None:
        """The answer to a request that must not pass, or None."""
        host = _hostname(request.headers.get("Host", ""))
        origin = request.headers.get("Origin")
        if self._local and not _is_local_name(host):
            return _refuse("this server answers to names of this machine only")
        if origin is not None and _hostname(urlsplit(origin).netloc) != host:
            return _refuse("pages of other sites may not talk to this server")
        if self._token is not None and not self._is_known(request):
            return _refuse("open the address that holds the token: /?token=...")
        return None

    def welcome(self, request: Request, response: Response | None) -> Response | None:
        """The server's response, the page under our own name; a token in the address becomes a cookie."""
        if response is None:
            return None
        if urlsplit(request.path).path in ("", "/", "/index.html"):
            response = self._named(response)
        if self._token is not None and _token_in_address(request) is not None:
            response.headers["Set-Cookie"] = f"{_COOKIE}={self._token}; HttpOnly; SameSite=Strict; Path=/"
        return response

    def _named(self, response: Response) -> Response:
        """The same page with the app's name and icon."""
        zipped = response.headers.get("Content-Encoding") == "gzip"
        if zipped not in self._pages:
            page = gzip.decompress(response.body) if zipped else bytes(response.body)
            page = branded(page)
            self._pages[zipped] = gzip.compress(page) if zipped else page
        headers = Headers(response.headers)
        del headers["Content-Length"]
        headers["Content-Length"] = str(len(self._pages[zipped]))
        return Response(response.status_code, response.reason_phrase, headers, self._pages[zipped])

    def _is_known(self, request: Request) -> bool:
        given = _token_in_address(request) or _token_in_cookie(request) or ""
        return self._token is not None and hmac.compare_digest(given.encode(), self._token.encode())


@contextmanager
def _guarding(guard: Guard) -> Any:
    """While open, servers of `websockets` are built with `guard` in front of their own responder."""
    build = websockets.asyncio.server.serve

    def build_guarded(*args: Any, process_request: Responder, **options: Any) -> Any:
        def respond(connection: Any, request: Request) -> Response | None:
            refusal = guard.refusal(request)
            return refusal if refusal is not None else guard.welcome(request, process_request(connection, request))

        return build(*args, process_request=respond, **options)

    with _patching:
        websockets.asyncio.server.serve = build_guarded  # type: ignore[assignment]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = build


def _admit_values_only(server: viser.ViserServer) -> None:
    """Let tabs set the values of widgets and nothing else of them, such as what happens on a click."""
    take = server.gui._handle_gui_updates
    server._websock_server.unregister_handler(viser_messages.GuiUpdateMessage, take)

    async def take_values(client_id: Any, message: viser_messages.GuiUpdateMessage) -> None:
        if set(message.updates) == {"value"}:
            await take(client_id, message)

    server._websock_server.register_handler(viser_messages.GuiUpdateMessage, take_values)


def _limit_uploads(server: viser.ViserServer) -> None:
    """Take no file that is too large, none that is larger than it said, and few at a time."""
    states, sockets = server.gui._current_file_upload_states, server._websock_server
    begin, take = server.gui._handle_file_transfer_start, server.gui._handle_file_transfer_part
    sockets.unregister_handler(viser_messages.FileTransferStartUpload, begin)
    sockets.unregister_handler(viser_messages.FileTransferPart, take)

    def begin_if_small(client_id: Any, message: viser_messages.FileTransferStartUpload) -> None:
        if 0 <= message.size_bytes <= MOST_BYTES and len(states) < _UPLOADS_AT_ONCE:
            begin(client_id, message)
        elif (client := server.get_clients().get(client_id)) is not None:
            text = f"A file may have {MOST_BYTES >> 20} MB, and {_UPLOADS_AT_ONCE} may be on their way at once."
            client.add_notification("Not taken", text, color=HIT, auto_close_seconds=None)

    def take_if_announced(client_id: Any, message: viser_messages.FileTransferPart) -> None:
        state = states.get(message.transfer_uuid)
        if state is not None and state["transferred_bytes"] + len(message.content) > state["total_bytes"]:
            del states[message.transfer_uuid]
        elif state is not None and state["client_id"] == client_id:
            take(client_id, message)

    sockets.register_handler(viser_messages.FileTransferStartUpload, begin_if_small)
    sockets.register_handler(viser_messages.FileTransferPart, take_if_announced)


def _refuse(reason: str) -> Response:
    body = f"nerfnav: {reason}\n".encode()
    headers = Headers({"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))})
    return Response(http.HTTPStatus.FORBIDDEN, "Forbidden", headers, body)


def _hostname(netloc: str) -> str:
    try:
        return urlsplit(f"//{netloc}").hostname or ""
    except ValueError:
        return ""


def _is_local_name(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _token_in_address(request: Request) -> str | None:
    values = parse_qs(urlsplit(request.path).query).get("token")
    return values[-1] if values else None


def _token_in_cookie(request: Request) -> str | None:
    try:
        cookie = SimpleCookie(request.headers.get("Cookie", "")).get(_COOKIE)
    except CookieError:
        return None
    return None if cookie is None else cookie.value
