"""A hostile connection, and what it is aimed at."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import msgspec
import viser
import zstandard
from websockets.sync.client import ClientConnection, connect

from tests.waiting import PATIENCE_S, until


def address(server: viser.ViserServer, scheme: str = "http") -> str:
    """Where a server is."""
    return f"{scheme}://127.0.0.1:{server.get_port()}/"


def connect_as_viser(server: viser.ViserServer, headers: dict[str, str] | None = None) -> ClientConnection:
    """A websocket connection, as viser's page opens it."""
    return connect(
        address(server, "ws"),
        additional_headers=headers or {},
        subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]
        compression=None,
        max_size=None,
        open_timeout=PATIENCE_S,
    )


CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1, 0, 0, 0],
    "position": [0, 0, 1],
    "fov": 0.8,
    "near": 0.01,
    "far": 1000,
    "image_height": 480,
    "image_width": 640,
    "look_at": [0, 0, 0],
    "up_direction": [0, 0, 1],
}
POSE = {"type": "TransformControlsUpdateMessage", "name": "/goal", "owner": "", "wxyz": [1, 0, 0, 0]}
NAN, INF = float("nan"), float("inf")


@dataclass
class Page:
    """A server with one widget of each kind, and all that its callbacks were told."""

    server: viser.ViserServer
    widgets: dict[str, Any] = field(default_factory=dict)
    told: list[Any] = field(default_factory=list)

    def values(self) -> dict[str, Any]:
        return {name: widget.value for name, widget in self.widgets.items()}


def update(widget: Any, **updates: Any) -> dict[str, Any]:
    """A page's message that sets something of a widget."""
    return {"type": "GuiUpdateMessage", "uuid": widget._impl.uuid, "updates": updates}


def assert_well(served: Page, attack: Callable[..., ClientConnection]) -> None:
    """Another tab is served as ever: what it sets arrives, and is told."""
    free = served.widgets["free"]
    aim = free.value + 1
    attack(update(free, value=aim))
    until(lambda: free.value == aim, "the server does not take a good value any more")
    until(lambda: any(event.target is free for event in served.told), "a good value is not told any more")


def messages_in(frame: bytes | str) -> list[dict[str, Any]]:
    """What one frame from the server says."""
    assert isinstance(frame, bytes)
    size, whole = int.from_bytes(frame[8:16], "little"), int.from_bytes(frame[:8], "little")
    return msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(frame[16 : 16 + size], whole))["messages"]


def replayed(served: Page) -> list[dict[str, Any]]:
    """All that a newcomer is sent."""
    with connect_as_viser(served.server) as newcomer:
        newcomer.send(msgspec.msgpack.encode(CAMERA))
        messages: list[dict[str, Any]] = []
        while not any(message["type"] == "ReplayDoneMessage" for message in messages):
            messages += messages_in(newcomer.recv(PATIENCE_S))
        return messages
