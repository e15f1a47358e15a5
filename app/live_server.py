"""The server of `nerfnav live`: one vehicle at a time, its pictures in, answers out.

The event loop reads messages and keeps the newest picture; one thread computes. The messages are those of
nerfnav/live/messages.py.
"""

import asyncio
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from http import HTTPStatus

import torch
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from nerfnav.core.errors import NerfnavError
from nerfnav.live import Answer, CameraCheck, Navigator, messages
from nerfnav.live.navigator import pixels_of
from nerfnav_app.security.access import AccessPolicy, silence_failed_handshakes
from nerfnav_app.system import TORCH_THREADS


@dataclass(frozen=True)
class _Came:
    """A picture that has come."""

    picture: messages.Picture
    text: bool
    """True if it came as text."""
    at: float = field(default_factory=time.perf_counter)
    """When [s]."""


class Newest:
    """Holds one picture: the newest that was not taken. Used from one event loop."""

    def __init__(self) -> None:
        """Nothing has come yet."""
        self._item: _Came | None = None
        self._there = asyncio.Event()
        self._dropped = 0

    def put(self, item: _Came) -> None:
        """This is newer than what is held."""
        self._dropped += self._item is not None
        self._item = item
        self._there.set()

    async def take(self) -> tuple[_Came, int]:
        """Wait for an item; and how many were dropped for newer ones since the last one was taken."""
        await self._there.wait()
        assert self._item is not None, "it is there"
        item, dropped = self._item, self._dropped
        self._item, self._dropped = None, 0
        self._there.clear()
        return item, dropped


_TAKEN = "another vehicle is connected: one is let in at a time"
_TRY_AGAIN_LATER = 1013


class LiveServer:
    """Lets one vehicle talk to a navigator."""

    def __init__(
        self,
        navigator: Navigator,
        welcome: messages.Welcome,
        host: str,
        token: str,
        checked: Callable[[CameraCheck], None] = lambda check: None,
    ) -> None:
        """Prepare a server that will listen at `host`; `checked` takes the check of each vehicle's camera."""
        self._navigator, self._welcome, self._checked = navigator, welcome, checked
        self._access = AccessPolicy(host, token, bytes)
        self._taken = self._is_checked = False
        self._host = host
        self._computing = ThreadPoolExecutor(1, initializer=torch.set_num_threads, initargs=(TORCH_THREADS,))

    async def run(self, port: int, preparing: Callable[[str], None], ready: Callable[[], None]) -> None:
        """Prepare, tell what is being done, listen, tell that it is ready, and serve until cancelled."""
        silence_failed_handshakes()
        try:
            await asyncio.get_running_loop().run_in_executor(self._computing, self._prepare, preparing)
            async with serve(
                self._vehicle, self._host, port,
                process_request=self._refusal, max_size=messages.MOST_BYTES, compression=None,
            ):  # fmt: skip
                ready()
                # not serve_forever: from Python 3.12.1 on, once cancelled, it waits until the vehicle has left, whom
                # only the end of this block tells to
                await asyncio.get_running_loop().create_future()
        finally:
            self._computing.shutdown(cancel_futures=True)

    def _prepare(self, preparing: Callable[[str], None]) -> None:
        """Runs in the thread that computes."""
        for doing in self._navigator.prepare():
            preparing(doing)

    def _refusal(self, connection: ServerConnection, request: Request) -> Response | None:
        """The answer to a request that must not pass, or None."""
        if request.headers.get("Origin") is not None:
            return connection.respond(HTTPStatus.FORBIDDEN, "nerfnav: vehicles are let in, and no pages\n")
        refused = self._access.refusal(request)
        if refused is None and self._taken:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, f"nerfnav: {_TAKEN}\n")
        return refused

    async def _vehicle(self, connection: ServerConnection) -> None:
        """Serve one connection to its end."""
        if self._taken:  # two have come at the same moment
            await connection.close(_TRY_AGAIN_LATER, _TAKEN)
            return
        self._taken, self._is_checked = True, False
        newest = Newest()
        try:
            await asyncio.get_running_loop().run_in_executor(self._computing, self._navigator.forget)
            await _say(connection, self._welcome, text=True)
            answering = asyncio.create_task(self._answering(connection, newest))
            reading = asyncio.create_task(_reading(connection, newest))
            done, left = await asyncio.wait((answering, reading), return_when=asyncio.FIRST_COMPLETED)
            for task in left:
                task.cancel()
            await asyncio.gather(*left, return_exceptions=True)
            for task in done:
                task.result()
        except ConnectionClosed:
            pass
        finally:
            self._taken = False

    async def _answering(self, connection: ServerConnection, newest: Newest) -> None:
        """Look at the newest picture, again and again."""
        loop = asyncio.get_running_loop()
        while True:
            came, dropped = await newest.take()
            try:
                answer = await loop.run_in_executor(self._computing, self._look, came)
            except NerfnavError as error:
                await _say(connection, messages.Error(str(error)), came.text)
            else:
                await _say(connection, messages.AnswerMessage(replace(answer, dropped=dropped)), came.text)

    def _look(self, came: _Came) -> Answer:
        """Runs in the thread that computes."""
        picture = came.picture
        pixels = pixels_of(picture, self._navigator.camera)
        waited = time.perf_counter() - came.at
        sent = picture.time if picture.now is None else picture.now
        answer = self._navigator.see(pixels, picture.time, picture.goal, sent + waited, picture.held)
        if answer.camera_check is not None and not self._is_checked:
            self._is_checked = True
            self._checked(answer.camera_check)
        return replace(answer, waited_ms=1e3 * waited)


async def _reading(connection: ServerConnection, newest: Newest) -> None:
    """Take what comes, until the vehicle leaves."""
    async for message in connection:
        try:
            newest.put(_Came(messages.decode_picture_message(message), isinstance(message, str)))
        except NerfnavError as error:
            await _say(connection, messages.Error(str(error)), isinstance(message, str))


async def _say(connection: ServerConnection, message: messages.FromServer, text: bool) -> None:
    with suppress(ConnectionClosed):
        await connection.send(messages.encode_message(message, text))
