"""The question whether something is to be deleted for good."""

from collections.abc import Callable

import viser

from nerfnav_app.page.html import note


def ask_to_delete(client: viser.ClientHandle, what: str, warning: str, really: Callable[[], None]) -> None:
    """Ask the one who wants it; `what` is "this flight", `warning` says what is lost.

    `really` is called on a thread of the server's pool.
    """
    modal = client.gui.add_modal(f"Delete {what}?")
    with modal:
        client.gui.add_html(note(warning))
        yes = client.gui.add_button("Delete for good", color="red", icon=viser.Icon.TRASH)
        no = client.gui.add_button("Keep it", color="gray")

    @yes.on_click
    def _(_: viser.GuiEvent) -> None:
        really()
        modal.close()

    @no.on_click
    async def _(_: viser.GuiEvent) -> None:
        modal.close()
