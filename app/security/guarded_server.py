"""Guarded viser server: accept only permitted visitors, and from them only messages that the page can send.

viser has no authentication, checks no Origin (any web page could drive a local server), lets every tab open a public
tunnel, lets a tab set any attribute of a widget, and keeps and replays whatever numbers a tab sends. All of this is
closed here, from outside: it leans on inner names of viser, whose version is therefore bounded in pyproject.toml.
Servers of `websockets` that are built inside `guarding` refuse as the policy does. Uploads are limited: none too
large or larger than it said, few at a time, to upload buttons alone.

    access           who may ask for anything: token, Host, Origin, how often
    message_filter   what a connection may send: how much, which messages, with sane contents
    widget_values    what a widget may be set to
    token_bucket     how much of something may happen
    address          whether a server can listen at an address, and the secret that visitors bring
"""

import contextlib
import io
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import viser
import viser._messages as viser_messages
import websockets.asyncio.server
from websockets.http11 import Request, Response

from nerfnav.core.errors import NerfnavError
from nerfnav_app.security.access import AccessPolicy, silence_failed_handshakes
from nerfnav_app.security.address import check_token
from nerfnav_app.security.message_filter import LARGEST_FRAME, MOST_WAITING, MessageFilter

_AT_ONCE = 4
_AT_ONCE_PER_TAB = 2
_SMALLEST_PART = 64 << 10  # pages send parts of 512 kB: many small ones are no upload


def limit_uploads(server: viser.ViserServer, most_bytes: int) -> None:
    """Put the limits before viser's own handlers of uploads: at most `most_bytes` in a file."""
    states, sockets, widgets = (
        server.gui._current_file_upload_states,
        server._websock_server,
        server.gui._gui_input_handle_from_uuid,
    )
    begin, take = server.gui._handle_file_transfer_start, server.gui._handle_file_transfer_part
    sockets.unregister_handler(viser_messages.FileTransferStartUpload, begin)
    sockets.unregister_handler(viser_messages.FileTransferPart, take)

    def is_for_a_button(uuid: str | None) -> bool:
        button = widgets.get(uuid or "")
        return isinstance(button, viser.GuiUploadButtonHandle) and not button.disabled

    def begin_if_small(client_id: int, message: viser_messages.FileTransferStartUpload) -> None:
        if not is_for_a_button(message.source_component_uuid) or message.transfer_uuid in states:
            return
        own = sum(state["client_id"] == client_id for state in states.values())
        room = len(states) < _AT_ONCE and own < _AT_ONCE_PER_TAB
        parts_fit = 0 <= message.part_count <= message.size_bytes // _SMALLEST_PART + 1
        if 0 <= message.size_bytes <= most_bytes and room and parts_fit:
            begin(client_id, message)  # type: ignore[arg-type]
        elif (client := server.get_clients().get(client_id)) is not None:
            text = f"A file may have {most_bytes >> 20} MB, and {_AT_ONCE} may be on their way at once."
            client.add_notification("Not taken", text, color="red", auto_close_seconds=None)

    def take_if_announced(client_id: int, message: viser_messages.FileTransferPart) -> None:
        state = states.get(message.transfer_uuid)
        if state is None or state["client_id"] != client_id or not is_for_a_button(message.source_component_uuid):
            return
        if state["transferred_bytes"] + len(message.content) > state["total_bytes"]:
            del states[message.transfer_uuid]
        else:
            take(client_id, message)  # type: ignore[arg-type]

    sockets.register_handler(viser_messages.FileTransferStartUpload, begin_if_small)  # type: ignore[arg-type]
    sockets.register_handler(viser_messages.FileTransferPart, take_if_announced)  # type: ignore[arg-type]


_patching = threading.Lock()
Responder = Callable[[Any, Request], Response | None]


@contextmanager
def guarding(access: AccessPolicy, message_filter: MessageFilter) -> Iterator[None]:
    """While open, servers of `websockets` are built behind `access` and `message_filter`."""
    build = websockets.asyncio.server.serve

    def build_guarded(handler: Any, *args: Any, process_request: Responder, **options: Any) -> Any:
        def respond(connection: Any, request: Request) -> Response | None:
            refusal = access.refusal(request)
            return refusal if refusal is not None else access.welcome(request, process_request(connection, request))

        options |= {"max_size": LARGEST_FRAME, "max_queue": MOST_WAITING}
        return build(message_filter.before(handler), *args, process_request=respond, **options)

    with _patching:
        websockets.asyncio.server.serve = build_guarded  # type: ignore[assignment]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = build


@dataclass(frozen=True)
class PagePolicy:
    """Page settings for the guard."""

    brand: Callable[[bytes], bytes]
    """viser's page (HTML) to the same under the app's name."""
    most_upload_bytes: int
    """Largest file that is taken [bytes]."""


def guarded_server(host: str, port: int, token: str | None, policy: PagePolicy) -> viser.ViserServer:
    """A viser server at `host`:`port` behind a guard; hosts that other machines reach must have a token.

    Raises TokenError for a missing or unusable token, NerfnavError where the port was taken meanwhile.
    """
    check_token(host, token)
    message_filter = MessageFilter()
    silence_failed_handshakes()
    access = AccessPolicy(host, token, policy.brand)
    with guarding(access, message_filter), contextlib.redirect_stdout(io.StringIO()):  # it prints a banner
        server = viser.ViserServer(host=host, port=port, verbose=False)
    if server.get_port() != port:  # another process took the port after it was checked
        server.stop()
        raise NerfnavError(f"port {port} of {host} was taken a moment ago: choose another with --port")
    limit_uploads(server, policy.most_upload_bytes)
    message_filter.open(server)
    return server
