"""The messages of `nerfnav live`, between a vehicle and the server, over a websocket. Nothing slow is imported here.

A binary message is a map in MessagePack, a text message the same in JSON with bytes as base64; the server answers in
the same way, and greets in JSON. Each message says in `type` what it is:

    server -> vehicle   welcome   once, at first: version, field, robot, camera, box
    vehicle -> server   picture   time, data, encoding, and perhaps size, now, goal, held
    server -> vehicle   answer    see Answer: one for each picture that was looked at
    server -> vehicle   error     sentence: what was wrong with the last message; the connection stays

Of pictures that come while one is looked at, the newest is looked at next; the others are counted in the answer's
`dropped`, and have no answer of their own. `encoding` is jpeg or png, a file; or rgb8 or bgr8, height x width x 3 bytes
with `size`. Messages have at most MOST_BYTES. The address holds the server's token: ws://127.0.0.1:8090/?token=T. One
vehicle at a time is let in.
"""

from dataclasses import dataclass
from typing import Any, Literal

import msgspec

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.live.answer import Answer, Goal, Vector

VERSION = 1
"""Of the messages."""
MOST_BYTES = 16 << 20
"""Of one of them."""
Encoding = Literal["jpeg", "png", "rgb8", "bgr8"]


@dataclass(frozen=True)
class Size:
    """Size of pictures [pixels]."""

    width: int
    height: int


class Picture(msgspec.Struct, frozen=True, tag="picture", forbid_unknown_fields=True, omit_defaults=True):
    """Picture with its time."""

    time: float
    """By the vehicle's clock [s]."""
    data: bytes
    """JPEG or PNG file, or pixels row by row."""
    encoding: Encoding = "jpeg"
    size: Size | None = None
    """Of rgb8 and bgr8."""
    now: float | None = None
    """What the vehicle's clock says as this is sent [s]; without it the picture counts as new."""
    goal: Goal | None = None
    """Where to arrive; without it no guidance is answered."""
    held: bool = False
    """The vehicle does not follow the guidance that was answered last, as where that came too late."""


class Welcome(msgspec.Struct, frozen=True, tag="welcome"):
    """Description of the server."""

    field: str
    robot: str
    camera: Size
    """Pictures are of these proportions."""
    box: tuple[Vector, Vector]
    """Lower and upper corner of the field [m]."""
    version: int = VERSION


class AnswerMessage(msgspec.Struct, frozen=True, tag="answer"):
    """Answer to a picture."""

    answer: Answer


class Error(msgspec.Struct, frozen=True, tag="error"):
    """Error in a message."""

    sentence: str


class MessageError(NerfnavError):
    """A message that is none of these."""


FromServer = Welcome | AnswerMessage | Error


def encode_message(message: Picture | FromServer, text: bool = False) -> bytes | str:
    """Encode a message: bytes, or text."""
    return msgspec.json.encode(message).decode() if text else msgspec.msgpack.encode(message)


def decode_picture_message(message: bytes | str) -> Picture:
    """Decode a message of a vehicle. Raises MessageError, in one sentence, where that is no picture."""
    return _decoded(message, Picture, "this is no picture message")


def decode_server_message(message: bytes | str) -> FromServer:
    """Decode a message of a server. Raises MessageError where that is none of its messages."""
    return _decoded(message, FromServer, "the server speaks otherwise than this client")


def _decoded(message: bytes | str, kind: Any, complaint: str) -> Any:
    try:
        if isinstance(message, str):
            return msgspec.json.decode(message, type=kind)
        return msgspec.msgpack.decode(message, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise MessageError(f"{complaint}: {error}") from error


def check_version(welcome: FromServer) -> Welcome:
    """The first message of a server, if it is a welcome in this version. Raises InvalidInputError."""
    if not isinstance(welcome, Welcome) or welcome.version != VERSION:
        raise InvalidInputError(f"the server does not speak version {VERSION} of nerfnav's live messages")
    return welcome
