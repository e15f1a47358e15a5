"""What a connection may send, and how much: a test for each hole. The server lives and serves the others."""

import time
from collections.abc import Callable
from typing import Any

import msgspec
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from nerfnav_app.security.message_filter import MOST_TABS, decode_message
from tests.app.security.hostile import (
    CAMERA,
    INF,
    NAN,
    POSE,
    Page,
    assert_well,
    connect_as_viser,
    replayed,
    update,
)
from tests.waiting import PATIENCE_S, until


@pytest.mark.parametrize(
    "pose",
    [
        {"position": [NAN, 0, 0]},
        {"position": [1e30, 0, 0]},
        {"position": [1, 2]},
        {"position": []},
        {"position": [1, 2, 3, 4]},
        {"position": ["a", 0, 0]},
        {"position": [0, 0, 0], "wxyz": [0, 0, 0, 0]},
        {"position": [0, 0, 0], "wxyz": [NAN, 0, 0, 0]},
        {"position": [0, 0, 0], "wxyz": [1, 0, 0]},
        {"position": [0, 0, 0], "name": "/nobody"},
        {"position": None},
        {},
    ],
    ids=lambda changes: str(changes)[:40],
)
def test_a_pose_that_is_none_does_not_move_a_gizmo(
    served: Page, attack: Callable[..., ClientConnection], pose: dict[str, Any]
) -> None:
    attack(POSE | pose)
    assert_well(served, attack)
    gizmo = served.gizmo  # type: ignore[attr-defined]
    assert gizmo.position.tolist() == [0, 0, 0] and gizmo.wxyz.tolist() == [1, 0, 0, 0]
    assert all(message.get("name") != "/nobody" for message in replayed(served))


def test_a_good_pose_moves_the_gizmo(served: Page, attack: Callable[..., ClientConnection]) -> None:
    attack(POSE | {"position": [0.1, 0.2, 0.3]})
    gizmo = served.gizmo  # type: ignore[attr-defined]
    until(lambda: gizmo.position.tolist() == [0.1, 0.2, 0.3], "the gizmo did not move")
    attack(POSE | {"position": [0, 0, 0]})
    until(lambda: gizmo.position.tolist() == [0, 0, 0], "the gizmo did not move back")


@pytest.mark.parametrize(
    "change",
    [
        {"position": [NAN, 0, 0]},
        {"wxyz": [0, 0, 0, 0]},
        {"fov": 0},
        {"fov": INF},
        {"image_width": 10**8},
        {"image_height": -5},
        {"near": 5, "far": 1},
        {"up_direction": [0, 0, 0]},
        {"look_at": [0, 0]},
    ],
    ids=lambda changes: str(changes)[:40],
)
def test_a_view_from_nowhere_is_not_taken(served: Page, change: dict[str, Any]) -> None:
    with connect_as_viser(served.server) as connection:
        known = set(served.server.get_clients())
        connection.send(msgspec.msgpack.encode(CAMERA | change))
        connection.send(msgspec.msgpack.encode(CAMERA | {"image_width": 333}))
        until(lambda: set(served.server.get_clients()) - known, "a good view was not taken")
        (new,) = set(served.server.get_clients()) - known
        assert served.server.get_clients()[new].camera.image_width == 333


CLICK = {"type": "ScenePointerMessage", "event_type": "click", "modifier": None}


@pytest.mark.parametrize(
    "change",
    [
        {"ray_origin": None, "ray_direction": [0, 0, 1], "screen_pos": [[0, 0]]},
        {"ray_origin": [0, 0, 0], "ray_direction": [0, NAN, 1], "screen_pos": [[0, 0]]},
        {"ray_origin": [INF, 0, 0], "ray_direction": [0, 0, 1], "screen_pos": [[0, 0]]},
        {"ray_origin": [0, 0, 0], "ray_direction": [0, 0, 0], "screen_pos": [[0, 0]]},
        {"ray_origin": [0, 0, 0], "ray_direction": [0, 0, 1], "screen_pos": []},
        {"ray_origin": [0, 0], "ray_direction": [0, 0, 1], "screen_pos": [[0, 0]]},
        {"event_type": "rect-select", "ray_origin": None, "ray_direction": None, "screen_pos": [[0, 0]]},
        {"event_type": "explode", "ray_origin": [0, 0, 0], "ray_direction": [0, 0, 1], "screen_pos": [[0, 0]]},
    ],
    ids=lambda changes: str(changes)[:40],
)
def test_a_click_that_is_none_is_not_told(change: dict[str, Any]) -> None:
    good = CLICK | {"ray_origin": [0, 0, 0], "ray_direction": [0, 0, 1], "screen_pos": [[0.5, 0.5]]}
    assert decode_message(msgspec.msgpack.encode(good)) is not None
    assert decode_message(msgspec.msgpack.encode(CLICK | change)) is None


@pytest.mark.parametrize(
    "raw",
    [
        b"",
        b"\xc1",
        b"\x00" * 100,
        b"\x91" * 50_000,  # lists in lists
        "text",
        msgspec.msgpack.encode(5),
        msgspec.msgpack.encode([1, 2]),
        msgspec.msgpack.encode({}),
        msgspec.msgpack.encode({"type": ["GuiUpdateMessage"]}),
        msgspec.msgpack.encode({"type": "NoSuchMessage"}),
        msgspec.msgpack.encode({"type": "ShareUrlRequest"}),
        msgspec.msgpack.encode({"type": "ShareUrlDisconnect"}),
        msgspec.msgpack.encode({"type": "RunJavascriptMessage", "source": "alert(1)"}),
        msgspec.msgpack.encode({"type": "RemoveSceneNodeMessage", "name": "/goal"}),
        msgspec.msgpack.encode({"type": "GuiFormDirtyMessage", "uuid": "x" * 5000}),
        msgspec.msgpack.encode(CAMERA | {"surprise": 1}),
        msgspec.msgpack.encode(POSE | {"position": [0, 0, 0], "name": 5}),
        msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "u", "updates": {"value": "x" * 200_000}}),
    ],
    ids=lambda raw: str(raw)[:40],
)
def test_what_no_page_sends_is_dropped_and_closes_nobody(
    served: Page, attack: Callable[..., ClientConnection], raw: bytes | str
) -> None:
    sender = attack(raw)
    assert_well(served, attack)
    assert decode_message(raw) is None
    assert served.server._share_tunnel is None
    free = served.widgets["free"]
    sender.send(msgspec.msgpack.encode(update(free, value=-7.0)))
    until(lambda: free.value == -7.0, "the sender was put out for one mistake")


def test_forms_that_are_not_there_are_not_remembered(served: Page, attack: Callable[..., ClientConnection]) -> None:
    assert_well(served, attack)  # its values are among what is remembered
    before = len(served.server._websock_server._broadcast_buffer.message_from_id)
    attack(*({"type": "GuiFormDirtyMessage", "uuid": f"form-{k}"} for k in range(25)))
    assert_well(served, attack)
    assert len(served.server._websock_server._broadcast_buffer.message_from_id) <= before + 1


def flood(connection: ClientConnection, raw: bytes, count: int) -> int | None:
    """Send `raw` again and again; the code with which the server closed, None where it bore it."""
    try:
        for _ in range(count):
            connection.send(raw)
        for _ in range(200):
            connection.recv(PATIENCE_S)
    except ConnectionClosed as closed:
        return None if closed.rcvd is None else closed.rcvd.code
    except TimeoutError:
        return None
    return None


@pytest.mark.parametrize("raw", [msgspec.msgpack.encode(CAMERA), b"\xc1"], ids=["good", "bad"])
def test_a_flood_closes_the_flooder_and_nobody_else(
    served: Page, attack: Callable[..., ClientConnection], raw: bytes
) -> None:
    other = attack()
    flooder = attack()
    began = time.monotonic()
    closed = flood(flooder, raw, 20_000)
    assert closed in (1008, None)
    until(lambda: flooder.state.name == "CLOSED", "the flooder is still there")
    assert time.monotonic() - began < 60, "it was borne for as long as a tab may that sends no faster"
    free = served.widgets["free"]
    other.send(msgspec.msgpack.encode(update(free, value=3.25)))
    until(lambda: free.value == 3.25, "the other tab was harmed")


def test_a_hand_that_drags_fast_is_no_flood(served: Page, attack: Callable[..., ClientConnection]) -> None:
    slider, connection = served.widgets["slider"], attack()
    for step in range(400):
        connection.send(msgspec.msgpack.encode(update(slider, value=(step % 10) / 10)))
    connection.send(msgspec.msgpack.encode(update(slider, value=1.0)))
    until(lambda: slider.value == 1.0, "the drag was cut off")


def test_only_so_many_tabs_are_let_in_and_one_that_leaves_makes_room(served: Page) -> None:
    tabs = [connect_as_viser(served.server) for _ in range(MOST_TABS)]
    try:
        with pytest.raises(ConnectionClosed, match="close one"):
            connect_as_viser(served.server).recv(PATIENCE_S)
        tabs.pop().close()

        def is_let_in() -> bool:
            try:
                with connect_as_viser(served.server) as late:
                    return bool(late.recv(PATIENCE_S))
            except (ConnectionClosed, InvalidStatus):  # no room, or too many tries in a moment
                return False

        until(is_let_in, "nobody may come although there is room")
    finally:
        for tab in tabs:
            tab.close()


def test_the_page_of_another_version_is_sent_away_quietly(served: Page, capfd: pytest.CaptureFixture[str]) -> None:
    url = f"ws://127.0.0.1:{served.server.get_port()}/"
    with (
        pytest.raises(ConnectionClosed, match="another version"),
        connect(url, subprotocols=["viser-v0"]) as old,  # type: ignore[list-item]
    ):
        old.recv(PATIENCE_S)
    assert capfd.readouterr().out == ""
