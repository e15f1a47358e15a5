"""Screenshots are drawn by the tab that asks, which may leave before it has drawn."""

import msgspec
import pytest

from nerfnav_app.page.panels.runs.screenshot import ScreenshotPanel
from nerfnav_app.page_server import page_server
from tests.app.security.hostile import CAMERA, connect_as_viser, messages_in, update
from tests.waiting import PATIENCE_S, free_port, until


def test_a_tab_that_leaves_before_its_screenshot_is_drawn_leaves_no_traceback(
    capfd: pytest.CaptureFixture[str],
) -> None:
    server, ended = page_server("127.0.0.1", free_port()), []
    try:
        panel = ScreenshotPanel(server, lambda command: None)
        shoot = panel._shoot
        panel._shot._impl.update_cb = [lambda event: (shoot(event), ended.append(event))[0]]
        with connect_as_viser(server) as tab:
            tab.send(msgspec.msgpack.encode(CAMERA))
            until(server.get_clients, "the tab was not let in")
            tab.send(msgspec.msgpack.encode(update(panel._shot, value=True)))
            asked = False
            while not asked:
                messages = messages_in(tab.recv(PATIENCE_S))
                asked = any(message["type"] == "GetRenderRequestMessage" for message in messages)
        until(lambda: not server.get_clients(), "the tab is still there")
        until(lambda: ended, "the screenshot is still waited for, or broke")
    finally:
        server.stop()
    assert "Traceback" not in capfd.readouterr().err
