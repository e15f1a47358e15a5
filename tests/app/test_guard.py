"""Who is let in, asked over real sockets."""

import socket
import urllib.error
import urllib.request
from collections.abc import Iterator

import pytest
import viser
import viser._messages as viser_messages
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app.guard import TokenError, guarded_server

TOKEN = "open-sesame_1"


def free_port() -> int:
    """A port that nobody listens at now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def guarded() -> Iterator[viser.ViserServer]:
    """A server with a token."""
    server = guarded_server("127.0.0.1", free_port(), TOKEN)
    yield server
    server.stop()


@pytest.fixture(scope="module")
def local() -> Iterator[viser.ViserServer]:
    """A server without a token, at this machine alone."""
    server = guarded_server("127.0.0.1", free_port(), None)
    yield server
    server.stop()


def status(url: str, **headers: str) -> int:
    """The HTTP status of a request."""
    try:
        return urllib.request.urlopen(urllib.request.Request(url, headers=headers)).status
    except urllib.error.HTTPError as error:
        return error.code


def address(server: viser.ViserServer, scheme: str = "http") -> str:
    """Where a server is."""
    return f"{scheme}://127.0.0.1:{server.get_port()}/"


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


def connect_as_viser(server: viser.ViserServer, headers: dict[str, str]):
    """A websocket connection, as viser's page opens it."""
    return connect(
        address(server, "ws"),
        additional_headers=headers,
        subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]
        compression=None,
    )


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


def test_hosts_that_others_reach_need_a_token() -> None:
    with pytest.raises(TokenError, match="--token"):
        guarded_server("0.0.0.0", free_port(), None)


@pytest.mark.parametrize("token", ["", "a b", "a;b", "ä", "a\nb"])
def test_a_token_that_cannot_travel_in_an_address_is_refused(token: str) -> None:
    with pytest.raises(TokenError, match="letters"):
        guarded_server("127.0.0.1", free_port(), token)


def test_nobody_can_ask_for_a_public_tunnel(local: viser.ViserServer) -> None:
    handlers = local._websock_server._incoming_handlers
    assert viser_messages.ShareUrlRequest not in handlers
    assert viser_messages.ShareUrlDisconnect not in handlers


def test_a_tab_can_set_values_but_nothing_else_of_a_widget(local: viser.ViserServer) -> None:
    box = local.gui.add_number("Number", 1.0)
    loop, (handler,) = local.get_event_loop(), local._websock_server._incoming_handlers[viser_messages.GuiUpdateMessage]

    def send(**updates: object) -> None:
        import asyncio

        message = viser_messages.GuiUpdateMessage(box._impl.uuid, dict(updates))
        asyncio.run_coroutine_threadsafe(handler(0, message), loop).result(5)  # type: ignore[arg-type]

    send(update_cb=["anything"])
    send(value=3.0, removed=True)
    assert box.value == 1.0 and box._impl.update_cb == [] and not box._impl.removed
    send(value=2.0)
    assert box.value == 2.0


def test_the_servers_banner_does_not_reach_the_output(capsys: pytest.CaptureFixture[str]) -> None:
    server = guarded_server("127.0.0.1", free_port(), None)
    assert capsys.readouterr().out == ""
    server.stop()
