"""Message filter: validation and rate limit of what an open connection sends to viser.

viser keeps what a tab sends and replays it to all who come later, so nonsense is stopped before it sees it: what is
malformed, of a kind that no page sends, not finite, or beyond what a widget can be set to is dropped and counts as
many messages; who sends too many is put out, alone.
"""

import dataclasses
from collections.abc import Awaitable, Callable
from typing import Any

import msgspec
import numpy as np
import viser
import viser._messages as viser_messages

from nerfnav_app.security.access import TokenBucket
from nerfnav_app.security.widget_values import LARGEST, LONGEST, is_number, may_set

MOST_TABS = 32
"""Connections at the same time."""
LARGEST_FRAME = 24 << 20
"""Largest message [bytes]: screenshots and parts of uploads are large, all others are small."""
MOST_WAITING = 4
"""Messages of one connection that wait to be read; the rest waits at the sender."""
_LARGEST_SMALL = 64 << 10  # [bytes]
_AT_ONCE, _PER_S = 600.0, 300.0  # messages of one connection: a hand that drags makes some hundred each second
_PRICE_OF_NONSENSE, _PRICE_OF_A_PART = 20.0, 0.25
_MOST_PIXELS = 16384  # along an edge of a page
_LARGE = (viser_messages.FileTransferPart, viser_messages.GetRenderResponseMessage)
_MESSAGES = {
    kind.__name__: kind
    for kind in (
        viser_messages.CommandTriggerMessage,
        viser_messages.FileTransferStartUpload,
        viser_messages.GuiButtonHoldMessage,
        viser_messages.GuiFormDirtyMessage,
        viser_messages.GuiFormSubmitMessage,
        viser_messages.GuiUpdateMessage,
        viser_messages.SceneNodeClickMessage,
        viser_messages.SceneNodeDragMessage,
        viser_messages.ScenePointerMessage,
        viser_messages.TransformControlsDragEndMessage,
        viser_messages.TransformControlsDragStartMessage,
        viser_messages.TransformControlsUpdateMessage,
        viser_messages.ViewerCameraMessage,
        *_LARGE,
    )
}
_FIELDS = {kind: frozenset(entry.name for entry in dataclasses.fields(kind)) for kind in _MESSAGES.values()}

Handler = Callable[[Any], Awaitable[None]]


class MessageFilter:
    """Stands between the connections and viser. Used on the server's event loop alone."""

    def __init__(self) -> None:
        self._server: viser.ViserServer | None = None
        self._inside = 0

    def open(self, server: viser.ViserServer) -> None:
        """Let connections through to `server`; before this, none is."""
        self._server = server

    def before(self, handler: Handler) -> Handler:
        """The same handler of connections, behind this filter."""

        async def handle(connection: Any) -> None:
            if self._server is None or self._inside >= MOST_TABS:
                await connection.close(1013, f"{MOST_TABS} tabs are open: close one")
            elif connection.subprotocol != f"viser-v{viser.__version__}":
                await connection.close(1002, "this is the page of another version: reload it")
            else:
                self._inside += 1
                try:
                    connection.recv = self._filtered(connection, TokenBucket(_AT_ONCE, _PER_S))
                    await handler(connection)
                finally:
                    self._inside -= 1

        return handle

    def _filtered(self, connection: Any, bucket: TokenBucket) -> Callable[[], Awaitable[bytes]]:
        """Make the function that gives the next message that may pass."""
        receive = connection.recv

        async def receive_sane() -> bytes:
            while True:
                raw = await receive()
                message = decode_message(raw)
                passes = message is not None and self._may_pass(connection, message)
                part = isinstance(message, viser_messages.FileTransferPart)
                price = (_PRICE_OF_A_PART if part else 1.0) if passes else _PRICE_OF_NONSENSE
                if not bucket.spend(price):
                    connection.close_timeout = 1
                    await connection.close(1008, "too many messages")
                    while True:  # what is still on its way, until it is closed
                        await receive()
                if passes:
                    return raw

        return receive_sane

    def _may_pass(self, connection: Any, message: viser_messages.Message) -> bool:
        assert self._server is not None, "nothing passes before the filter is open"
        gui, scene = self._server.gui, self._server.scene
        match message:
            case viser_messages.GuiUpdateMessage(uuid, updates):
                return self._may_update(connection, uuid, updates)
            case viser_messages.GuiFormDirtyMessage(uuid) | viser_messages.GuiFormSubmitMessage(uuid):
                return isinstance(gui._container_handle_from_uuid.get(uuid), viser.GuiFormHandle)
            case viser_messages.CommandTriggerMessage(uuid):
                return uuid in gui._command_handle_from_uuid
            case viser_messages.TransformControlsUpdateMessage(name):
                return name in scene._handle_from_transform_controls_name
            case _:
                return True

    def _may_update(self, connection: Any, uuid: str, updates: dict[str, Any]) -> bool:
        """Check whether a tab may change a widget so; a tab that may not is sent the present value."""
        assert self._server is not None
        live = self._server._websock_server._live_connections
        client = self._server._connected_clients.get(next((id for id, at in live.items() if at is connection), -1))
        if client is None:
            return False  # a page says where it looks from before anything else
        widget = self._server.gui._gui_input_handle_from_uuid.get(uuid)
        widget = widget or client.gui._gui_input_handle_from_uuid.get(uuid)
        if widget is None or may_set(widget, updates):
            return widget is not None
        if "value" in updates and isinstance(widget, viser.GuiInputHandle):
            truth = viser_messages.GuiUpdateMessage(uuid, {"value": widget.value})
            client._websock_connection.queue_message(truth)
        return False


def decode_message(raw: bytes | str) -> viser_messages.Message | None:
    """The message, if it is one that a page can send, whole and with sane numbers and texts; else None."""
    if isinstance(raw, str):
        return None
    try:
        fields = msgspec.msgpack.decode(raw)
        kind = _MESSAGES[fields.pop("type")]
        if len(raw) > _LARGEST_SMALL and kind not in _LARGE:
            return None
        message = msgspec.convert(fields, kind)
    except (msgspec.MsgspecError, RecursionError, AttributeError, KeyError, TypeError):
        return None
    if not fields.keys() <= _FIELDS[kind] or not all(_is_sane(value) for value in vars(message).values()):
        return None
    return message if _makes_sense(message) else None


def _is_sane(value: Any) -> bool:
    """Check that numbers are finite and of sensible size, and texts not endless, at any depth."""
    if isinstance(value, float):
        return is_number(value)
    if isinstance(value, int):
        return abs(value) <= LARGEST
    if isinstance(value, str):
        return len(value) <= LONGEST
    if isinstance(value, list | tuple):
        return len(value) <= LONGEST and all(_is_sane(entry) for entry in value)
    if isinstance(value, dict):
        return len(value) <= LONGEST and all(_is_sane(entry) for pair in value.items() for entry in pair)
    return True


def _makes_sense(message: viser_messages.Message) -> bool:
    """Check attitudes and views of a message."""
    match message:
        case viser_messages.TransformControlsUpdateMessage():
            return _is_attitude(message.wxyz)
        case viser_messages.ViewerCameraMessage():
            return (
                _is_attitude(message.wxyz)
                and 0 < message.fov < np.pi
                and 0 < message.near < message.far
                and 0 <= message.image_width <= _MOST_PIXELS
                and 0 <= message.image_height <= _MOST_PIXELS
                and bool(np.any(message.up_direction))
            )
        case viser_messages.ScenePointerMessage():
            if message.event_type == "click":
                whole = message.ray_origin is not None and message.ray_direction is not None
                return whole and any(message.ray_direction or ()) and len(message.screen_pos) == 1
            return len(message.screen_pos) == 2
        case _:
            return True


def _is_attitude(wxyz: tuple[float, ...]) -> bool:
    return 0.5 < float(np.linalg.norm(wxyz)) < 2
