"""Take the trajectory away, and begin again."""

from collections.abc import Callable
from typing import Any

import viser

from app.messages import Command, Reset, Tell
from app.session import Session
from app.widgets import note
from nerfnav.export.tables import Table, csv_text, episode_table, json_text, motion_table
from nerfnav.navigation.episode import Episode

_TEXTS: dict[str, Callable[[Table], str]] = {"CSV": csv_text, "JSON": json_text}


class ExportPanel:
    """Downloads of the last flight, or of the plan where nothing was flown; and the reset button."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._post = post
        self._session: Session | None = None
        self._said = server.gui.add_html(note("Nothing to take away yet."))
        self._download = server.gui.add_button_group("Download", tuple(_TEXTS), visible=False)
        self._reset = server.gui.add_button("Reset", color="gray", icon=viser.Icon.REFRESH)
        self._download.on_click(self._send)

        @self._reset.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(Reset())

    def show(self, session: Session) -> None:
        """Say what there is to take away."""
        self._session = session
        name = subject(session)
        self._download.visible = name is not None
        self._said.content = note(
            f"The {name} as a table of time, pose, velocities and actions." if name else "Nothing to take away yet."
        )

    def _send(self, event: viser.GuiEvent[Any]) -> None:
        """Send the file to the tab that asked; runs on a thread of the server's pool."""
        session, form = self._session, event.target.value
        if event.client is None or session is None or form not in _TEXTS:
            return
        made = export_table(session)
        if made is None:
            self._post(Tell("Nothing to take away", "Plan or fly first.", bad=True))
            return
        name = f"{session.place.name if session.place else 'nerfnav'}-{subject(session)}.{form.lower()}"
        event.client.send_file_download(name, _TEXTS[form](made).encode(), save_immediately=True)


def subject(session: Session) -> str | None:
    """What would be exported: the flight, else the plan, else nothing."""
    if session.flight is not None and len(session.flight.steps) > 1:
        return "flight"
    return "plan" if session.plan is not None and session.plan.latest is not None else None


def export_table(session: Session) -> Table | None:
    """The flight or the plan as a table."""
    if session.place is None:
        return None
    robot = session.place.robot
    if session.flight is not None and len(session.flight.steps) > 1:
        return episode_table(Episode.of(list(session.flight.steps)), robot.action_names, robot.name)
    if session.plan is not None and session.plan.latest is not None:
        return motion_table(session.plan.latest.motion, robot.action_names, robot.name)
    return None
