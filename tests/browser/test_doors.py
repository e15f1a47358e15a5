"""A hostile connection beside a real page: the page does not notice."""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import msgspec
import numpy as np
from websockets.exceptions import ConnectionClosed, InvalidStatus

from nerfnav_app.page.layers.ends import GIZMO
from nerfnav_app.places.ends import EndRole
from nerfnav_app.server import App
from tests.app.doubles import ScriptedWork
from tests.app.security.hostile import CAMERA, NAN, POSE, connect_as_viser
from tests.browser.tab import Tab
from tests.waiting import PATIENCE_S

_WIDGETS = "() => document.querySelectorAll('input, [role=tab]').length"


def nonsense(app: App) -> list[bytes]:
    """What no page would send, aimed at all that this app has."""
    assert app._server is not None
    uuids = [*app._server.gui._gui_input_handle_from_uuid, *app._server.gui._command_handle_from_uuid]
    places = ([NAN] * 3, [1e30] * 3, [])
    poses = [POSE | {"name": f"/{which.value}", "position": place} for which in EndRole for place in places]
    values = [NAN, 1e30, "x" * 5000, [NAN, 0, 0], None, {"a": 1}]
    updates = [
        {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {name: value}}
        for uuid in uuids
        for name, value in [*(("value", value) for value in values), ("visible", False), ("disabled", True)]
    ]
    others = [{"type": "ShareUrlRequest"}, {"type": "ResetGuiMessage"}]
    others += [{"type": "RemoveSceneNodeMessage", "name": "/goal"}]
    return [b"\xc1", *(msgspec.msgpack.encode(message) for message in (*poses, *updates, *others))]


def attack(app: App) -> None:
    """Send all of it, coming back whenever one is put out."""
    waiting = nonsense(app)
    while waiting:
        try:
            with connect_as_viser(app._server) as hostile:  # type: ignore[arg-type]
                hostile.send(msgspec.msgpack.encode(CAMERA))
                few, waiting = waiting[:25], waiting[25:]
                for raw in few:
                    hostile.send(raw)
                hostile.recv(PATIENCE_S)
        except ConnectionClosed:
            continue
        except InvalidStatus:  # too many connections in a moment
            time.sleep(0.2)


def test_a_page_lives_on_beside_a_hostile_connection(serve: Callable[..., App], open_tab: Callable[[App], Tab]) -> None:
    app = serve(ScriptedWork())
    tab = open_tab(app)
    before, widgets = app.session, tab.page.evaluate(_WIDGETS)
    with ThreadPoolExecutor(1) as aside:
        hostile = aside.submit(attack, app)
        while not hostile.done():
            tab.page.wait_for_timeout(100)
        hostile.result()  # all of it was sent
    session = app.session
    assert (session.ends, session.choice, session.flight_settings, session.view_settings) == (
        before.ends, before.choice, before.flight_settings, before.view_settings
    )  # fmt: skip
    assert session.job is None and session.notices == before.notices
    for which in EndRole:
        np.testing.assert_allclose(tab.position(which), session.ends.of(which).position, atol=1e-5)
    tab.until_shown()
    assert tab.page.evaluate(_WIDGETS) == widgets > 10
    tab.drag_along_x(EndRole.GOAL, -0.2, GIZMO)
    tab.until(lambda: app.session.ends != before.ends, "the page was harmed")
    tab.load()
    tab.until_ends_agree()
