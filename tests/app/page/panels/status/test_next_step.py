"""Whoever presses a button means what it said, also where something else comes next by the time that it is heard."""

from collections.abc import Iterator

import msgspec
import pytest
import viser

from nerfnav_app.page.panels.status.next_step import NextButtons
from nerfnav_app.page_server import page_server
from nerfnav_app.state.actions import Cancel, Command, StartFlight, StartPlan
from nerfnav_app.state.session import Session
from tests.app.security.hostile import CAMERA, connect_as_viser, update
from tests.app.sessions import after, planned
from tests.waiting import free_port, until


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    server = page_server("127.0.0.1", free_port())
    yield server
    server.stop()


@pytest.mark.parametrize("meant", [Cancel, StartPlan, StartFlight])
def test_a_press_that_comes_late_means_what_the_button_said(
    server: viser.ViserServer, opened: Session, meant: type[Command]
) -> None:
    told: list[Command] = []
    buttons = NextButtons(server, told.append)
    busy, ready = after(opened, StartPlan()), planned(opened)
    before = {StartPlan: opened, Cancel: busy, StartFlight: ready}[meant]
    buttons.show(before, visible=True)
    pressed = shown(buttons)
    with connect_as_viser(server) as tab:
        tab.send(msgspec.msgpack.encode(CAMERA))
        until(server.get_clients, "the tab was not let in")
        for now in (opened, busy, ready):
            told.clear()
            buttons.show(now, visible=True)
            assert (shown(buttons) is pressed) == (now is before)
            tab.send(msgspec.msgpack.encode(update(pressed, value=True)))
            until(lambda: told, "the press is not heard")
            assert [type(command) for command in told] == [meant]


def test_nothing_is_offered_where_something_is_asked(server: viser.ViserServer, opened: Session) -> None:
    buttons = NextButtons(server, lambda command: None)
    buttons.show(opened, visible=False)
    assert not any(button.visible for button in buttons._buttons.values())


def shown(buttons: NextButtons) -> viser.GuiButtonHandle:
    """The one button that is shown."""
    (button,) = (button for button in buttons._buttons.values() if button.visible)
    return button
