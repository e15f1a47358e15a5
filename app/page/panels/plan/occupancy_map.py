"""Occupancy map panel: download the map of free, solid and unproven space that planners use."""

from collections.abc import Callable
from typing import Any

import viser

from nerfnav_app.page.kit.html import note
from nerfnav_app.state.actions import Command
from nerfnav_app.state.job import Download, JobKind, MapDownload, TakeMap
from nerfnav_app.state.session import Session

MAPS = {"Voxels (.npz)": ".npz", "Collision mesh (.glb)": ".glb", "Map of ROS (.pgm, .yaml)": ".pgm"}
"""What a person chooses, and the ending that stands for it."""


class OccupancyMapPanel:
    """A kind of map, and a button that has it made and sends it to the tab that asked."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._server, self._post = server, post
        self._sent: int | None = None
        server.gui.add_html(note("The place as planners take it: free, solid or unproven, before any robot is put in."))
        self._kind: viser.GuiDropdownHandle[str] = server.gui.add_dropdown("Map", list(MAPS))
        self._download = server.gui.add_button("Download map", icon=viser.Icon.MAP_2, disabled=True)
        self._download.on_click(self._ask)

    async def _ask(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            self._post(TakeMap(MapDownload(MAPS[self._kind.value], event.client.client_id)))

    def show(self, session: Session) -> None:
        """Send what was made."""
        making = session.job is not None and session.job.kind is JobKind.MAP
        self._download.disabled = session.place is None or making
        made = session.download
        if made is not None and made.id != self._sent:
            self._sent = made.id
            self._send(made)

    def _send(self, made: Download) -> None:
        """To the tab that asked, unless it is closed."""
        client = self._server.get_clients().get(made.client)
        if client is not None:
            client.send_file_download(made.name, made.content, save_immediately=True)
