"""A server to be attacked, and who attacks it."""

from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import pytest
from websockets.sync.client import ClientConnection

from nerfnav_app.page_server import page_server
from tests.app.security.hostile import CAMERA, Page, connect_as_viser, update
from tests.waiting import free_port, until


@pytest.fixture
def served() -> Iterator[Page]:
    """A server of the test's own: connections that others used up or left behind do not count."""
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
    mark = gui.add_number("m", 0)
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
    page.gizmo, page.upload, page.button, page.mark = gizmo, upload, button, mark  # type: ignore[attr-defined]
    yield page
    server.stop()


@pytest.fixture
def attack(served: Page) -> Iterator[Callable[..., ClientConnection]]:
    """Opens a connection that says where it looks from; sends what it is given, and waits until that is taken in."""
    opened: list[ClientConnection] = []

    def open_and_send(*messages: Any) -> ClientConnection:
        known = set(served.server.get_clients())
        connection = connect_as_viser(served.server)
        opened.append(connection)
        connection.send(msgspec.msgpack.encode(CAMERA))
        until(lambda: set(served.server.get_clients()) - known, "the tab was not let in")
        for message in messages:
            connection.send(message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message))
        if messages:  # are dealt with in their order: what comes last is seen when all are
            mark = served.mark  # type: ignore[attr-defined]
            aim = mark.value + 1
            connection.send(msgspec.msgpack.encode(update(mark, value=aim)))
            until(lambda: mark.value == aim, "the server does not take a good value any more")
        return connection

    yield open_and_send
    for connection in opened:
        connection.close()
