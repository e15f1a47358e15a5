"""The socket of `nerfnav live`, over real connections; what navigates is a double, which answers when it is told."""

import asyncio
import logging
import re
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit

import cv2
import msgspec
import numpy as np
import pytest
from torch import Tensor
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera
from nerfnav.live import Answer, Goal, Guidance, LiveClient, LiveError, Order, Setpoint
from nerfnav.live.messages import MOST_BYTES, Size, Welcome
from nerfnav_app.live_server import LiveServer
from tests.waiting import PATIENCE_S, free_port, until

TOKEN = "sesame"
CAMERA = Camera.from_fov(40, 30, 90)
PICTURE = np.random.default_rng(0).integers(0, 256, (30, 40, 3), np.uint8)
POINT = Setpoint(1.0, (1, 2, 3), (0, 0, 0), (0, 0, 0), 0.5)


class Double:
    """Answers with what it was given; waits for `free` before."""

    camera = CAMERA

    def __init__(self) -> None:
        self.seen: list[tuple[float, Goal | None, float | None]] = []
        self.pictures: list[Tensor] = []
        self.held: list[bool] = []
        self.forgotten = 0
        self.free = threading.Event()
        self.free.set()

    def prepare(self) -> Iterator[str]:
        yield "preparing"

    def forget(self) -> None:
        self.forgotten += 1

    def see(
        self, picture: Tensor, time: float, goal: Goal | None = None, now: float | None = None, held: bool = False
    ) -> Answer:
        self.seen.append((time, goal, now))
        self.pictures.append(picture)
        self.held.append(held)
        assert self.free.wait(PATIENCE_S)
        if time < 0:
            raise InvalidInputError("this time is before the beginning")
        guidance = None if goal is None else Guidance(Order.FOLLOW, "", (POINT,), 0.25)
        return Answer(time, "followed", "", (1, 2, 3), (1, 0, 0, 0), (0, 0, 0), ((0.5,) * 6,) * 6, guidance, 2.0, 3.0)


@contextmanager
def serving(double: Double) -> Iterator[str]:
    """A server in a thread of its own; gives its address, without the token."""
    port, told, loops = free_port(), threading.Event(), []
    welcome = Welcome("hall", "quadrotor", Size(40, 30), ((0, 0, 0), (1, 1, 1)))
    server = LiveServer(double, welcome, "127.0.0.1", TOKEN)  # pyright: ignore[reportArgumentType]

    async def run() -> None:
        loops.append((asyncio.get_running_loop(), asyncio.current_task()))
        await server.run(port, lambda _: None, told.set)

    def thread() -> None:
        with pytest.raises(asyncio.CancelledError):
            asyncio.run(run())

    runner = threading.Thread(target=thread)
    runner.start()
    try:
        assert told.wait(PATIENCE_S)
        yield f"ws://127.0.0.1:{port}"
    finally:
        double.free.set()
        loop, task = loops[0]
        loop.call_soon_threadsafe(task.cancel)
        runner.join(PATIENCE_S)
        assert not runner.is_alive()


@pytest.fixture
def double() -> Double:
    return Double()


@pytest.fixture
def address(double: Double) -> Iterator[str]:
    with serving(double) as where:
        yield f"{where}/?token={TOKEN}"


def test_pictures_go_in_and_answers_come_out(double: Double, address: str) -> None:
    with LiveClient(address) as live:
        assert (live.welcome.field, live.welcome.robot, live.welcome.camera) == ("hall", "quadrotor", Size(40, 30))
        began = time.monotonic()
        answer = live.see(PICTURE, 7.5)
        assert (answer.time, answer.position, answer.guidance) == (7.5, (1, 2, 3), None)
        assert answer.covariance == ((0.5,) * 6,) * 6
        assert answer.latency_ms == pytest.approx(answer.waited_ms + 5) and answer.waited_ms > 0
        lasted = time.monotonic() - began
        guided = live.see(PICTURE, 7.6, Goal((1, 2, 0.5), 0.3), now=7.65, held=True).guidance
        assert guided is not None and guided.order is Order.FOLLOW and guided.setpoints == (POINT,)
    (_, none, now), (_, goal, later) = double.seen
    assert none is None and now is not None and 7.5 < now < 7.5 + lasted
    assert goal == Goal((1, 2, 0.5), 0.3) and later is not None and later > 7.65, "the time that it waited counts"
    assert (double.pictures[0].numpy() == PICTURE).all() and double.held == [False, True]


def test_files_and_pixels_of_either_order_are_pictures(double: Double, address: str) -> None:
    done, png = cv2.imencode(".png", PICTURE[..., ::-1])
    assert done
    with connect(address) as socket:
        socket.recv()
        for data, more in (
            (png.tobytes(), {"encoding": "png"}),
            (PICTURE[..., ::-1].tobytes(), {"encoding": "bgr8", "size": {"width": 40, "height": 30}}),
        ):
            socket.send(msgspec.msgpack.encode({"type": "picture", "time": 1.0, "data": data, **more}))
            assert msgspec.msgpack.decode(socket.recv())["type"] == "answer"  # type: ignore[arg-type]
        told = {"type": "picture", "time": 2.0, "data": png.tobytes(), "encoding": "png"}
        socket.send(msgspec.json.encode(told).decode())
        answered = socket.recv()
        assert isinstance(answered, str) and msgspec.json.decode(answered)["answer"]["time"] == 2.0
    assert all((picture.numpy() == PICTURE).all() for picture in double.pictures) and len(double.pictures) == 3


BAD: tuple[tuple[object, str], ...] = (
    (b"\xff\x00nonsense", "this is no picture message"),
    ("{", "this is no picture message"),
    ({"type": "dance"}, "this is no picture message: Invalid value 'dance'"),
    ({"type": "picture", "time": "noon", "data": b""}, r"Expected `float`, got `str` - at `\$.time`"),
    ({"type": "picture", "data": b""}, "missing required field `time`"),
    ({"type": "picture", "time": 1.0, "data": b"", "gaol": None}, "unknown field `gaol`"),
    ({"type": "picture", "time": 1.0, "data": b"\xff\xd8nothing"}, "the picture of 1.000 s is no jpeg file"),
    ({"type": "picture", "time": 1.0, "data": bytes(9), "encoding": "rgb8"}, "needs its size"),
    ({"type": "picture", "time": 1.0, "data": bytes(9), "encoding": "rgb8", "size": {"width": 40, "height": 30}},
     "40 x 30 pixels of rgb8 are 3600 bytes, not 9"),
    ({"type": "picture", "time": 1.0, "data": bytes(27), "encoding": "rgb8", "size": {"width": 9, "height": 1}},
     "give a picture of the same proportions"),
    ({"type": "picture", "time": 1.0, "data": bytes(9), "encoding": "rgb8", "size": {"width": 40000, "height": 30000}},
     "pictures have at most 16777216 pixels"),
    ({"type": "picture", "time": 1.0, "data": b"", "goal": {"position": [1, 2]}}, r"Expected `array` of length 3"),
)  # fmt: skip


def test_bad_messages_are_answered_by_a_sentence_and_the_connection_stays(double: Double, address: str) -> None:
    with connect(address) as socket:
        socket.recv()
        for message, complaint in BAD:
            said = sentence(socket, message)
            assert "\n" not in said and re.search(complaint, said), said
    assert double.seen == []


def sentence(socket: ClientConnection, message: object) -> str:
    raw = message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message)
    socket.send(raw)
    answer = socket.recv(PATIENCE_S)
    told = msgspec.json.decode(answer) if isinstance(answer, str) else msgspec.msgpack.decode(answer)
    assert told["type"] == "error" and isinstance(answer, str) is isinstance(raw, str)
    return told["sentence"]


def test_what_the_navigator_refuses_is_told_to_the_client(address: str) -> None:
    with LiveClient(address) as live:
        with pytest.raises(InvalidInputError, match="this time is before the beginning"):
            live.see(PICTURE, -1.0)
        assert live.see(PICTURE, 1.0).time == 1.0


def test_a_grey_picture_is_refused(address: str) -> None:
    done, grey = cv2.imencode(".jpg", PICTURE[..., 0])
    assert done
    with LiveClient(address) as live, pytest.raises(InvalidInputError, match="it is grey"):
        live.see(grey.tobytes(), 1.0)


def test_of_pictures_that_come_too_fast_the_newest_is_seen_and_the_others_are_counted(
    double: Double, address: str
) -> None:
    with LiveClient(address) as live:
        double.free.clear()
        live.send(PICTURE, 1.0)
        until(lambda: double.seen, "the first picture is looked at")
        for taken in (2.0, 3.0, 4.0):
            live.send(PICTURE, taken)
        assert live.answer(0.1) is None
        sent = live._socket
        assert sent.ping().wait(PATIENCE_S), "the server has read what was sent before this"
        double.free.set()
        first, second = live.answer(PATIENCE_S), live.answer(PATIENCE_S)
        assert first is not None and (first.time, first.dropped) == (1.0, 0)
        assert second is not None and (second.time, second.dropped) == (4.0, 2)
        assert live.answer(0.1) is None
    assert [taken for taken, *_ in double.seen] == [1.0, 4.0]


def test_one_vehicle_is_let_in_at_a_time_and_the_next_begins_anew(double: Double, address: str) -> None:
    with LiveClient(address) as live:
        with pytest.raises(LiveError, match="another vehicle is connected: one is let in at a time"):
            LiveClient(address)
        assert live.see(PICTURE, 1.0).time == 1.0, "the first one does not notice"
    until(lambda: can_connect(address), "the next one is let in")
    assert double.forgotten >= 2


def can_connect(address: str) -> bool:
    try:
        LiveClient(address).close()
    except LiveError:
        return False
    return True


@pytest.mark.parametrize("query", ["", "?token=", "?token=wrong"])
def test_without_the_token_nobody_is_let_in(address: str, query: str) -> None:
    with pytest.raises(LiveError, match="open the address that holds the token"):
        LiveClient(address.split("?")[0] + query)


@pytest.mark.parametrize("headers", [{"Origin": "http://evil.example"}, {"Origin": "http://127.0.0.1"}])
def test_pages_are_not_let_in_even_with_the_token(address: str, headers: dict[str, str]) -> None:
    with pytest.raises(InvalidStatus) as refused:
        connect(address, additional_headers=headers)
    assert refused.value.response.status_code == 403


def test_a_message_that_is_too_large_ends_the_connection_and_the_next_vehicle_is_let_in(address: str) -> None:
    with connect(address) as socket:
        socket.recv()
        with pytest.raises(ConnectionClosed) as closed:
            socket.send(bytes(MOST_BYTES + 1))
            socket.recv(PATIENCE_S)
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 1009
    until(lambda: can_connect(address), "the next one is let in")


@pytest.mark.parametrize("sent", [
    b"", b"nonsense\r\n\r\n", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(40), b"\xff" * 10_000,
    b"GET / HTTP/1.1\r\nHost: [::1\r\n\r\n",
])  # fmt: skip
def test_a_probe_of_the_port_is_logged_nowhere(address: str, sent: bytes, caplog: pytest.LogCaptureFixture) -> None:
    where = urlsplit(address)
    with socket.create_connection((where.hostname, where.port), PATIENCE_S) as probe:
        probe.sendall(sent)
        probe.shutdown(socket.SHUT_WR)
        with suppress(ConnectionError):
            while probe.recv(4096):
                pass
    until(lambda: can_connect(address), "a vehicle is let in")
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]


def test_a_server_that_ends_tells_the_vehicle(double: Double) -> None:
    with serving(double) as where:
        live = LiveClient(f"{where}/?token={TOKEN}")
    with pytest.raises(LiveError, match="the server"):
        live.see(PICTURE, 1.0)


def test_where_nobody_listens_a_client_says_so_without_the_token() -> None:
    with pytest.raises(LiveError, match=r"no `nerfnav live` answers at 127\.0\.0\.1:9") as told:
        LiveClient("ws://127.0.0.1:9/?token=secret")
    assert "secret" not in str(told.value)
