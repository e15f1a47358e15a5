"""Export panel: download the trajectory of the flight or of the plan, in one of the formats."""

from collections.abc import Callable
from typing import Any

import viser

from nerfnav.core.errors import NerfnavError
from nerfnav.export import FORMATS, ExportFormat, explain_unsafe
from nerfnav_app.page.kit.html import note
from nerfnav_app.state.actions import Command, Notify
from nerfnav_app.state.export_subject import find_outcome, make_recording, name_download, name_subject
from nerfnav_app.state.job import TrajectoryDownload
from nerfnav_app.state.session import Session
from nerfnav_app.text import sentence


class ExportPanel:
    """Panel that exports the last flight, or the plan where nothing was flown."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._post = post
        self._session: Session | None = None
        self._subject = server.gui.add_html(note("Nothing to export yet: plan or fly first."))
        self._format: viser.GuiDropdownHandle[str] = server.gui.add_dropdown("Format", list(FORMATS), visible=False)
        self._purpose = server.gui.add_html("", visible=False)
        self._force = server.gui.add_checkbox("Export anyway", False, visible=False)
        self._download = server.gui.add_button("Download", icon=viser.Icon.DOWNLOAD, visible=False)
        self._format.on_update(self._select)
        self._download.on_click(self._send)

    def show(self, session: Session) -> None:
        """Show the subject of the export and the formats for it."""
        self._session = session
        name = name_subject(session)
        for handle in (self._format, self._purpose, self._download):
            handle.visible = name is not None
        self._subject.content = note(f"Export the {name} as" if name else "Nothing to export yet: plan or fly first.")
        names = tuple(formats_for(name))
        if self._format.options != names:
            before = self._format.value
            self._format.options = names
            self._format.value = before if before in names else names[0]
        self._describe()

    async def _select(self, event: viser.GuiEvent[Any]) -> None:
        self._describe()

    def _describe(self) -> None:
        form = FORMATS[self._format.value]
        why = "" if self._session is None else explain_unsafe(find_outcome(self._session), form)
        self._purpose.content = note(" ".join(map(sentence, filter(None, (f"{form.purpose} (.{form.ending})", why)))))
        forced = bool(why) or form.moves_vehicle
        self._force.visible = forced
        if not forced and self._force.value:
            self._force.value = False

    def _send(self, event: viser.GuiEvent[Any]) -> None:
        """Send the file to the tab that requests it; runs on a thread of the server's pool."""
        session, name = self._session, self._format.value
        if event.client is None or session is None:
            return
        made, form = make_recording(session), FORMATS[name]
        if made is None:
            self._post(Notify("Nothing to export", "Plan or fly first.", bad=True))
            return
        why = explain_unsafe(find_outcome(session), form)
        if why and not self._force.value:
            self._post(Notify("Not exported", f"{sentence(why)} Tick Export anyway to download it.", bad=True))
            return
        if form.moves_vehicle:  # the worker first checks trajectories of vehicles in the field
            self._post(TrajectoryDownload(name, event.client.client_id, self._force.value))
            return
        try:
            content = form.exported(made, self._force.value).content
        except NerfnavError as error:
            self._post(Notify("Not exported", sentence(str(error)), bad=True))
        else:
            event.client.send_file_download(name_download(session, name), content, save_immediately=True)


def formats_for(subject: str | None) -> dict[str, ExportFormat]:
    """Select the formats of a flight or a plan, without those that need a place on Earth."""
    return {
        name: form
        for name, form in FORMATS.items()
        if not form.needs_datum and (subject != "plan" or not form.flights_only)
    }
