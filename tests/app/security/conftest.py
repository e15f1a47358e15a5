"""A server to be attacked, and who attacks it."""

from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import pytest
from websockets.sync.client import ClientConnection

from app.page_server import page_server
from tests.app.security.hostile import CAMERA, Page, connect_as_viser, free_port, until


@pytest.fixture(scope="module")
def served() -> Iterator[Page]:
    """One server for all tests of this file: who harms it harms the tests that come later."""
    server = page_server("127.0.0.1", free_port(), None)
    gui, page = server.gui, Page(server)
    page.widgets = {
        "number": gui.add_number("n", 0.5, min=0.0, max=1.0),
        "free": gui.add_number("f", 0.5),
        "slider": gui.add_slider("s", 0.0, 1.0, 0.1, 0.5),
        "vector": gui.add_vector3("v", (0.0, 0.0, 0.0), min=(-1.0, -1.0, -1.0), max=(1.0, 1.0, 1.0)),
        "text": gui.add_text("t", "name"),
        "check": gui.add_checkbox("c", False),
        "list": gui.add_dropdown("l", ("a", "b")),
        "group": gui.add_button_group("g", ("x", "y")),
        "off": gui.add_number("o", 0.5, disabled=True),
    }
    upload = gui.add_upload_button("u")
    button = gui.add_button("b", disabled=True)
    command = gui.add_command("c", disabled=True)
    gizmo = server.scene.add_transform_controls("/goal")
    for name, widget in page.widgets.items():
        (widget.on_click if name == "group" else widget.on_update)(page.told.append)
    button.on_click(page.told.append)
    command.on_trigger(page.told.append)
    gizmo.on_update(page.told.append)
    upload.on_upload(page.told.append)
    server.scene.on_click()(page.told.append)
    page.gizmo, page.upload, page.button = gizmo, upload, button  # type: ignore[attr-defined]
    yield page
    server.stop()


@pytest.fixture
def attack(served: Page) -> Iterator[Callable[..., ClientConnection]]:
    """Opens a connection that has said where it looks from, and sends what it is given."""
    opened: list[ClientConnection] = []

    def open_and_send(*messages: Any) -> ClientConnection:
        known = set(served.server.get_clients())
        connection = connect_as_viser(served.server)
        opened.append(connection)
        connection.send(msgspec.msgpack.encode(CAMERA))
        until(lambda: set(served.server.get_clients()) - known, "the tab was not let in")
        for message in messages:
            connection.send(message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message))
        return connection

    served.told.clear()
    yield open_and_send
    for connection in opened:
        connection.close()
