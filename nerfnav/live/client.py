"""A client of `nerfnav live`, for the vehicle's side.

with LiveClient("ws://127.0.0.1:8090/?token=T") as live:
    answer = live.see(picture, time, Goal((1, 2, 1)))          # waits for the answer
    live.send(picture, time, Goal((1, 2, 1)))                  # does not wait ...
    answer = live.answer(timeout=0)                            # ... None while there is none
"""

from contextlib import AbstractContextManager
from types import TracebackType
from urllib.parse import urlsplit

import numpy as np
from websockets.exceptions import ConnectionClosed, InvalidStatus, WebSocketException
from websockets.sync.client import connect

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.live.answer import Answer, Goal
from nerfnav.live.messages import (
    AnswerMessage,
    Error,
    Picture,
    Size,
    Welcome,
    check_version,
    decode_server_message,
    encode_message,
)

_PATIENCE_S = 60.0


class LiveError(NerfnavError):
    """The server does not answer as one should."""


class LiveClient(AbstractContextManager["LiveClient"]):
    """Connection of a vehicle to a server."""

    welcome: Welcome
    """Description of the server."""

    def __init__(self, address: str, timeout: float = _PATIENCE_S) -> None:
        """Connect to an address with its token. Raises LiveError where no server answers, or it refuses.

        `timeout` [s] is how long anything may take: the first picture is looked for everywhere, which takes seconds.
        """
        self._timeout = timeout
        try:
            self._socket = connect(address, open_timeout=timeout, max_size=None, compression=None)
        except InvalidStatus as error:
            reason = bytes(error.response.body or b"").decode(errors="replace").strip()
            raise LiveError(reason or f"{_named(address)} refuses: {error}") from error
        except (OSError, WebSocketException, TimeoutError, ValueError) as error:
            raise LiveError(f"no `nerfnav live` answers at {_named(address)}: {error}") from error
        self.welcome = check_version(self._received(timeout))

    def see(
        self,
        picture: np.ndarray | bytes,
        time: float,
        goal: Goal | None = None,
        now: float | None = None,
        held: bool = False,
    ) -> Answer:
        """Return the answer to a picture, see Navigator.see; it is RGB (height, width, 3), or the bytes of a JPEG file.

        Raises InvalidInputError for what the server refuses, LiveError where it is gone or does not answer.
        """
        self.send(picture, time, goal, now, held)
        answer = self.answer(self._timeout)
        if answer is None:
            raise LiveError(f"the server has not answered within {self._timeout:g} s")
        return answer

    def send(
        self,
        picture: np.ndarray | bytes,
        time: float,
        goal: Goal | None = None,
        now: float | None = None,
        held: bool = False,
    ) -> None:
        """Send a picture and do not wait. Raises LiveError where the server is gone."""
        try:
            self._socket.send(encode_message(_message(picture, time, goal, now, held)))
        except ConnectionClosed as error:
            raise LiveError(_why(error)) from error

    def answer(self, timeout: float | None = 0) -> Answer | None:
        """The next answer; None where there is none within a time [s]. Raises as `see` does."""
        try:
            message = self._received(timeout)
        except TimeoutError:
            return None
        if isinstance(message, Error):
            raise InvalidInputError(message.sentence)
        if not isinstance(message, AnswerMessage):
            raise LiveError("the server said something else than an answer")
        return message.answer

    def close(self) -> None:
        """Close the connection to the server."""
        self._socket.close()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Close the connection to the server."""
        self.close()

    def _received(self, timeout: float | None) -> Welcome | AnswerMessage | Error:
        try:
            return decode_server_message(self._socket.recv(timeout))
        except ConnectionClosed as error:
            raise LiveError(_why(error)) from error


def _message(
    picture: np.ndarray | bytes, time: float, goal: Goal | None, now: float | None, held: bool
) -> Picture:
    if isinstance(picture, bytes):
        return Picture(time, picture, now=now, goal=goal, held=held)
    if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3:
        raise InvalidInputError(f"pictures are uint8, height x width x RGB, not {picture.dtype} of {picture.shape}")
    return Picture(time, picture.tobytes(), "rgb8", Size(picture.shape[1], picture.shape[0]), now, goal, held)


def _named(address: str) -> str:
    """An address without its secret."""
    return urlsplit(address).netloc or address


def _why(error: ConnectionClosed) -> str:
    said = error.rcvd or error.sent
    return f"the server has closed the connection: {said.reason or said.code}" if said else "the server is gone"
