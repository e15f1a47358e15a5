"""Which uploads are taken."""

from collections.abc import Callable
from typing import Any

import msgspec
import pytest
from websockets.sync.client import ClientConnection

from tests.app.security.hostile import (
    Page,
    assert_well,
)
from tests.waiting import until


def start(served: Page, **changes: Any) -> dict[str, Any]:
    """The announcement of an upload of 5 bytes."""
    announced = {
        "type": "FileTransferStartUpload",
        "source_component_uuid": served.upload._impl.uuid,  # type: ignore[attr-defined]
        "transfer_uuid": "t",
        "filename": "a.npz",
        "mime_type": "",
        "part_count": 1,
        "size_bytes": 5,
    }
    return announced | changes


def part(served: Page, content: bytes = b"12345", **changes: Any) -> dict[str, Any]:
    """A part of that upload."""
    sent = {
        "type": "FileTransferPart",
        "source_component_uuid": served.upload._impl.uuid,  # type: ignore[attr-defined]
        "transfer_uuid": "t",
        "part_index": 0,
        "content": content,
    }
    return sent | changes


def test_an_upload_arrives(served: Page, attack: Callable[..., ClientConnection]) -> None:
    attack(start(served), part(served))
    until(lambda: served.told, "the upload did not arrive")
    assert served.upload.value.content == b"12345"  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "changes",
    [
        {"size_bytes": 1 << 40},
        {"size_bytes": -1},
        {"part_count": -1},
        {"part_count": 10**6},
        {"filename": "x" * 5000},
        {"source_component_uuid": "nobody"},
    ],
    ids=lambda changes: str(changes)[:40],
)
def test_an_upload_that_cannot_be_is_not_begun(
    served: Page, attack: Callable[..., ClientConnection], changes: dict[str, Any]
) -> None:
    attack(start(served, **changes), part(served))
    assert_well(served, attack)
    assert not served.server.gui._current_file_upload_states
    assert all(event.target is served.widgets["free"] for event in served.told)


def test_an_upload_cannot_be_given_to_what_is_no_upload_button(
    served: Page, attack: Callable[..., ClientConnection]
) -> None:
    number = served.widgets["number"]
    before, uuid = number.value, number._impl.uuid
    first = attack(start(served, source_component_uuid=uuid), part(served, source_component_uuid=uuid))
    second = attack(start(served, transfer_uuid="u"), part(served, transfer_uuid="u", source_component_uuid=uuid))
    assert_well(served, attack)
    assert number.value == before
    first.close()
    second.close()


def test_nobody_can_add_to_or_replace_the_upload_of_another_or_begin_too_many(
    served: Page, attack: Callable[..., ClientConnection]
) -> None:
    states = served.server.gui._current_file_upload_states
    owner = attack(start(served))
    until(lambda: "t" in states, "the upload was not begun")
    thief = attack(part(served, b"evil!"), start(served, size_bytes=4), start(served, transfer_uuid="own"))
    hog = attack(*(start(served, transfer_uuid=f"hog-{k}") for k in range(20)))
    until(lambda: len(states) == 4, "the other uploads were not begun")
    assert states["t"]["total_bytes"] == 5 and not states["t"]["parts"]
    assert sum(state["client_id"] == states["own"]["client_id"] for state in states.values()) == 1
    owner.send(msgspec.msgpack.encode(part(served, b"mine!")))
    until(lambda: served.upload.value.content == b"mine!", "the owner's upload was harmed")  # type: ignore[attr-defined]
    thief.close()
    hog.close()
    until(lambda: not states, "what was left unfinished is kept for good")
