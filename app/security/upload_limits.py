"""Which uploads are taken: none too large or larger than it said, few at a time, to upload buttons alone."""

import viser
import viser._messages as viser_messages

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
