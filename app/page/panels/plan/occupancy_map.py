"""Occupancy map panel: download the map of free, solid and unproven space that planners use."""

from collections.abc import Callable
from typing import Any

import viser

from nerfnav_app.page.kit.html import note
from nerfnav_app.state.actions import Command
from nerfnav_app.state.job import JobKind, MapDownload
from nerfnav_app.state.session import Session

MAPS = {"Voxels (.npz)": ".npz", "Collision mesh (.glb)": ".glb", "Map of ROS (.pgm, .yaml)": ".pgm"}
"""Labels of the kinds of maps, and the suffixes of their files."""


class OccupancyMapPanel:
    """Panel of the occupancy map: its kind, and a button that downloads it."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._server, self._post = server, post
        self._sent: int | None = None
        server.gui.add_html(note("Occupancy map of the planners: free, solid and unproven space, without a robot."))
        self._kind: viser.GuiDropdownHandle[str] = server.gui.add_dropdown("Map", list(MAPS))
        self._download = server.gui.add_button("Download map", icon=viser.Icon.MAP_2, disabled=True)
        self._download.on_click(self._request)

    async def _request(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            self._post(MapDownload(MAPS[self._kind.value], event.client.client_id))

    def show(self, session: Session) -> None:
        """Send a file that was made."""
        making = session.job is not None and session.job.kind is JobKind.MAP
        self._download.disabled = session.place is None or making
        made = session.download
        if made is not None and made.id != self._sent:
            self._sent = made.id
            client = self._server.get_clients().get(made.client)
            if client is not None:  # else the tab that requested it is closed
                client.send_file_download(made.name, made.content, save_immediately=True)
