"""Access policy: decide which requests get a page or a connection.

token: `/?token=T` sets a cookie; without it, or with a wrong one, there is neither page nor connection
Host and Origin: only names of this server, so that no page of another site can talk to it (DNS rebinding included)
connections: so many in a moment, for each of them is sent the whole scene
"""

import gzip
import hmac
import http
import ipaddress
import logging
import time
from collections.abc import Callable
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from nerfnav_app.security.address import is_loopback

_COOKIE = "nerfnav_token"
_CONNECTIONS_AT_ONCE, _CONNECTIONS_PER_S = 64.0, 16.0


class AccessPolicy:
    """Decides on each request before viser sees it."""

    def __init__(self, host: str, token: str | None, brand: Callable[[bytes], bytes]) -> None:
        """`host` is what the server listens at; `brand` gives viser's page (HTML) the app's name."""
        self._local = is_loopback(host)
        self._token, self._brand = token, brand
        self._pages: dict[bool, bytes] = {}
        self._connections = TokenBucket(_CONNECTIONS_AT_ONCE, _CONNECTIONS_PER_S)

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
        if request.headers.get("Upgrade") is not None and not self._connections.spend(1):
            return _refuse("too many connections in a moment", http.HTTPStatus.SERVICE_UNAVAILABLE)
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
            page = self._brand(page)
            self._pages[zipped] = gzip.compress(page) if zipped else page
        headers = Headers(response.headers)
        del headers["Content-Length"]
        headers["Content-Length"] = str(len(self._pages[zipped]))
        return Response(response.status_code, response.reason_phrase, headers, self._pages[zipped])

    def _is_known(self, request: Request) -> bool:
        given = _token_in_address(request) or _token_in_cookie(request) or ""
        return self._token is not None and hmac.compare_digest(given.encode(), self._token.encode())


def _refuse(reason: str, status: http.HTTPStatus = http.HTTPStatus.FORBIDDEN) -> Response:
    body = f"nerfnav: {reason}\n".encode()
    headers = Headers({"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))})
    return Response(status, status.phrase, headers, body)


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


class TokenBucket:
    """Fills with time, is emptied by what happens."""

    def __init__(self, most: float, per_s: float, now: Callable[[], float] = time.monotonic) -> None:
        """Full at first; `most` is what it holds, `per_s` what it gains each second, `now` a clock [s]."""
        self._most, self._per_s, self._now = most, per_s, now
        self._left, self._at = most, now()

    def spend(self, amount: float) -> bool:
        """Take `amount` if it is there; whether it was."""
        now = self._now()
        self._left = min(self._most, self._left + (now - self._at) * self._per_s)
        self._at = now
        if amount > self._left:
            return False
        self._left -= amount
        return True


def silence_failed_handshakes() -> None:
    """Log no tracebacks of visitors that speak no HTTP, or leave before asking: probes of a port, TLS."""
    logging.getLogger("websockets.server").addFilter(_is_worth_telling)


def _is_worth_telling(record: logging.LogRecord) -> bool:
    return record.getMessage() != "opening handshake failed"
