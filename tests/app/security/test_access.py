"""Who is let in, asked over real sockets."""

import contextlib
import logging
import socket
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import Iterator

import pytest
import viser
from websockets.exceptions import InvalidStatus

from nerfnav_app.page_server import page_server
from nerfnav_app.security.access import TokenBucket
from nerfnav_app.security.address import TokenError
from tests.app.security.hostile import address, connect_as_viser
from tests.waiting import PATIENCE_S, free_port, until

TOKEN = "open-sesame_1"
CROWD = 200
"""Connections that are asked for at once."""


@pytest.fixture(scope="module")
def guarded() -> Iterator[viser.ViserServer]:
    """A server with a token."""
    server = page_server("127.0.0.1", free_port(), TOKEN)
    yield server
    server.stop()


@pytest.fixture(scope="module")
def local() -> Iterator[viser.ViserServer]:
    """A server without a token, at this machine alone."""
    server = page_server("127.0.0.1", free_port(), None)
    yield server
    server.stop()


def status(url: str, **headers: str) -> int:
    """The HTTP status of a request."""
    try:
        return urllib.request.urlopen(urllib.request.Request(url, headers=headers)).status
    except urllib.error.HTTPError as error:
        return error.code


def test_the_token_in_the_address_becomes_a_cookie_that_opens_page_and_connection(guarded: viser.ViserServer) -> None:
    response = urllib.request.urlopen(address(guarded) + f"?token={TOKEN}")
    cookie = response.headers["Set-Cookie"].split(";")[0]
    assert "HttpOnly" in response.headers["Set-Cookie"] and "SameSite=Strict" in response.headers["Set-Cookie"]
    assert status(address(guarded), Cookie=cookie) == 200
    connect_as_viser(guarded, {"Cookie": cookie}).close()


@pytest.mark.parametrize("query", ["", "?token=", "?token=wrong", f"?token={TOKEN}x"])
def test_without_the_right_token_there_is_no_page(guarded: viser.ViserServer, query: str) -> None:
    assert status(address(guarded) + query) == 403


@pytest.mark.parametrize("cookie", ["", "nerfnav_token=wrong", "nerfnav_token", ";;="])
def test_without_the_right_cookie_there_is_no_connection(guarded: viser.ViserServer, cookie: str) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        connect_as_viser(guarded, {"Cookie": cookie})


def test_a_local_server_needs_no_token_and_answers_to_local_names_only(local: viser.ViserServer) -> None:
    port = local.get_port()
    assert status(address(local)) == 200
    assert status(address(local), Host=f"localhost:{port}") == 200
    for name in ("evil.example", f"evil.example:{port}", "127.0.0.1.evil.example", "[", ""):
        assert status(address(local), Host=name) == 403, name


def test_pages_of_other_sites_cannot_connect(local: viser.ViserServer) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        connect_as_viser(local, {"Origin": "http://evil.example"})
    connect_as_viser(local, {"Origin": address(local)[:-1]}).close()


@pytest.mark.parametrize("path", ["../pyproject.toml", "..%2f..%2fpyproject.toml", "%2e%2e/%2e%2e/etc/passwd", "..\\x"])
def test_no_path_leads_out_of_the_page(local: viser.ViserServer, path: str) -> None:
    with socket.create_connection(("127.0.0.1", local.get_port())) as plain:
        plain.sendall(f"GET /{path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
        assert b" 404 " in plain.recv(100)


def test_hosts_that_others_reach_need_a_token() -> None:
    with pytest.raises(TokenError, match="--token"):
        page_server("0.0.0.0", free_port(), None)


@pytest.mark.parametrize("token", ["", "a b", "a;b", "ä", "a\nb"])
def test_a_token_that_cannot_travel_in_an_address_is_refused(token: str) -> None:
    with pytest.raises(TokenError, match="letters"):
        page_server("127.0.0.1", free_port(), token)


def test_too_many_connections_in_a_moment_are_refused_and_a_moment_later_they_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("nerfnav_app.security.access._CONNECTIONS_PER_S", 1.0)  # however slowly the crowd is answered
    server = page_server("127.0.0.1", free_port(), None)
    upgrade = "GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    upgrade += "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    at = ("127.0.0.1", server.get_port())

    def is_let_in() -> bool:
        try:
            connect_as_viser(server).close()
        except InvalidStatus:
            return False
        return True

    try:
        with contextlib.ExitStack() as stack:
            crowd = [stack.enter_context(socket.create_connection(at, PATIENCE_S)) for _ in range(CROWD)]
            for one in crowd:  # asked all together: a slow machine must not spread them over time
                one.sendall(upgrade.encode())
            answers = Counter(one.recv(12) for one in crowd)
        assert set(answers) == {b"HTTP/1.1 101", b"HTTP/1.1 503"}, answers
        until(is_let_in, "whoever comes later is refused too")
    finally:
        server.stop()


@pytest.mark.parametrize("begun", [b"", b"GET / HT"], ids=["nothing", "half a request"])
def test_whoever_leaves_before_asking_leaves_no_traceback(
    begun: bytes, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(logging.getLogger("websockets.server"), "filters", [])  # those of servers before
    server = page_server("127.0.0.1", free_port())
    try:
        with socket.create_connection(("127.0.0.1", server.get_port())) as plain:
            plain.sendall(begun)
            plain.shutdown(socket.SHUT_WR)
            plain.settimeout(PATIENCE_S)
            with contextlib.suppress(ConnectionResetError):
                assert plain.recv(1) == b"", "the server waits for more"
        assert status(address(server)) == 200
    finally:
        server.stop()
    assert [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR] == []


def test_the_servers_banner_does_not_reach_the_output(capsys: pytest.CaptureFixture[str]) -> None:
    server = page_server("127.0.0.1", free_port(), None)
    assert capsys.readouterr().out == ""
    server.stop()


def test_a_purse_gives_what_it_holds_and_fills_again_but_not_over() -> None:
    clock = [0.0]
    purse = TokenBucket(10, 2, now=lambda: clock[0])
    assert purse.spend(10) and not purse.spend(1)
    clock[0] = 1.0
    assert purse.spend(2) and not purse.spend(0.1)
    clock[0] = 1000.0
    assert not purse.spend(10.1) and purse.spend(10)
