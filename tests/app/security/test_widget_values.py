"""What a tab may set a widget to: refused values are not stored, not told, not replayed."""

from collections.abc import Callable
from typing import Any

import pytest
from websockets.sync.client import ClientConnection

from nerfnav_app.security.widget_values import may_set
from tests.app.security.hostile import (
    INF,
    NAN,
    Page,
    assert_well,
    messages_in,
    replayed,
    update,
)
from tests.waiting import PATIENCE_S, until

BAD_VALUES = [
    *[("number", value) for value in (NAN, INF, 1e30, -0.5, 1.5, "0.5", None, [0.5], True, {})],
    *[("free", value) for value in (NAN, -INF, 1e30, 2**62, "1")],
    *[("slider", value) for value in (NAN, 7.0, -1, "a")],
    *[("vector", value) for value in ([NAN, 0, 0], [1e30, 0, 0], [0, 0], [0] * 4, [], [2, 0, 0], "abc", 1.0)],
    *[("text", value) for value in ("x" * 100_000, 5, None, ["a"], b"a")],
    *[("check", value) for value in (1, "yes", None, [])],
    *[("list", value) for value in ("c", "", 0, None, ["a"])],
    *[("group", value) for value in ("z", 1, None)],
    *[("off", value) for value in (0.7,)],
]


@pytest.mark.parametrize(("name", "value"), BAD_VALUES, ids=lambda value: str(value)[:20])
def test_a_value_that_a_widget_cannot_have_is_refused(served: Page, name: str, value: Any) -> None:
    assert not may_set(served.widgets[name], {"value": value})


def test_refused_values_are_neither_stored_nor_told_nor_replayed(
    served: Page, attack: Callable[..., ClientConnection]
) -> None:
    before, sent = served.values(), [update(served.widgets[name], value=value) for name, value in BAD_VALUES]
    for few in (sent[start : start + 15] for start in range(0, len(sent), 15)):  # more at once would be a flood
        attack(*few)
    assert served.told == []
    assert_well(served, attack)
    assert [event for event in served.told if event.target is not served.widgets["free"]] == []
    assert served.values() | {"free": 0} == before | {"free": 0}
    uuids = {widget._impl.uuid: name for name, widget in served.widgets.items()}
    for message in replayed(served):
        if message["type"] == "GuiUpdateMessage" and message["uuid"] in uuids and "value" in message["updates"]:
            assert message["updates"]["value"] == served.values()[uuids[message["uuid"]]]


def test_good_values_arrive(served: Page, attack: Callable[..., ClientConnection]) -> None:
    good = {"number": 0.25, "slider": 0.3, "vector": [1, -1, 0.5], "text": "other", "check": True, "list": "b"}
    attack(*(update(served.widgets[name], value=value) for name, value in good.items()))
    until(lambda: served.values()["list"] == "b", "a good value was refused")
    assert served.values() | {"vector": [1, -1, 0.5]} == served.values() | good


def test_a_tab_whose_value_is_refused_is_told_the_true_one(
    served: Page, attack: Callable[..., ClientConnection]
) -> None:
    off = served.widgets["off"]  # which no other test sets, so that no replay holds its value
    connection = attack(update(off, value=0.7))
    for _ in range(200):
        for message in messages_in(connection.recv(PATIENCE_S)):
            if message["type"] == "GuiUpdateMessage" and message["uuid"] == off._impl.uuid:
                assert message["updates"] == {"value": 0.5}
                return
    pytest.fail("nobody told it")


def test_nothing_but_the_value_of_a_widget_can_be_set(served: Page, attack: Callable[..., ClientConnection]) -> None:
    number = served.widgets["number"]
    attack(
        update(number, update_cb=["anything"]),
        update(number, value=0.9, removed=True),
        update(number, max=1e9),
        update(number, sync_cb=None),
        update(number),
        {"type": "GuiUpdateMessage", "uuid": "nobody", "updates": {"value": 1}},
    )
    assert_well(served, attack)
    assert not number._impl.removed and number.max == 1.0 and number.value != 0.9 and callable(number._impl.sync_cb)


def test_what_is_disabled_cannot_be_pressed(served: Page, attack: Callable[..., ClientConnection]) -> None:
    commands = list(served.server.gui._command_handle_from_uuid)
    attack(update(served.button, value=True), *({"type": "CommandTriggerMessage", "uuid": uuid} for uuid in commands))  # type: ignore[attr-defined]
    assert_well(served, attack)
    assert [event for event in served.told if event.target is not served.widgets["free"]] == []
