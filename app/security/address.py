"""Server address and token: check, before a server is built, that it can listen there and has a secret if it must.

viser silently takes the next port when the asked one is taken, and hangs on a host that cannot be bound. A server
that other machines reach must have a token, which visitors bring.
"""

import errno
import ipaddress
import re
import socket

from nerfnav.core.errors import NerfnavError


class AddressError(NerfnavError):
    """An address that no server can listen at."""


def check_address(host: str, port: int) -> None:
    """Return if a server can listen at `host`:`port` now; raise AddressError that says why it cannot."""
    if not 1 <= port <= 65535:
        raise AddressError(f"a port is a number from 1 to 65535, not {port}")
    try:
        found = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError) as error:
        raise AddressError(f"{_no_interface(host)} (the name is not known)") from error
    for family, kind, protocol, _, address in found:
        with socket.socket(family, kind, protocol) as probe:
            # as servers do: a port that lately closed connections still linger on is free
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(address)
            except OSError as error:
                raise AddressError(_reason(host, port, error)) from error


def is_loopback(host: str) -> bool:
    """Check whether only this machine reaches `host`."""
    try:
        addresses = {str(entry[4][0]) for entry in socket.getaddrinfo(host, None)} if host else set()
    except (OSError, UnicodeError):
        return False
    return bool(addresses) and all(ipaddress.ip_address(entry.split("%")[0]).is_loopback for entry in addresses)


def page_url(host: str, port: int, token: str | None) -> str:
    """URL of the page of a server, token included."""
    name = "localhost" if host in ("0.0.0.0", "::", "") else host
    return f"http://{name}:{port}/" + (f"?token={token}" if token else "")


def _reason(host: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port {port} of {host} is taken: stop what listens there, or choose another with --port"
    if error.errno == errno.EACCES:
        return f"this user may not listen at port {port}: choose one above 1023 with --port"
    if error.errno == errno.EADDRNOTAVAIL:
        return _no_interface(host)
    return f"no server can listen at {host}:{port}: {error.strerror}"


def _no_interface(host: str) -> str:
    return f"no network interface of this machine is called {host!r}: use 127.0.0.1, or 0.0.0.0 for all of them"


class TokenError(NerfnavError):
    """A server that others can reach would have no token."""


def check_token(host: str, token: str | None) -> None:
    """Raise TokenError for a missing or unusable token; only a server that this machine alone reaches needs none."""
    if token is None and not is_loopback(host):
        raise TokenError(
            f"all that reach {host} could steer this app: give it a secret with --token, or serve at 127.0.0.1"
        )
    if token is not None and not re.fullmatch(r"[A-Za-z0-9._~-]+", token):
        raise TokenError("a token is made of letters, digits, '.', '_', '~' and '-', for it travels in addresses")
