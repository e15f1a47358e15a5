"""Notifications: good news pops up once in every tab. Errors stay in the status line until they are resolved."""

import viser

from nerfnav_app.page.kit.theme import START
from nerfnav_app.state.session import Session

_SECONDS = 8.0


class NoticesLayer:
    """Layer of new notices; a tab that opens later does not show the earlier ones."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._shown = -1

    def show(self, session: Session) -> None:
        """Pop up the notices since the last call."""
        for notice in session.notices:
            if notice.id <= self._shown:
                continue
            self._shown = notice.id
            if notice.bad:
                continue
            for client in self._server.get_clients().values():
                client.add_notification(notice.title, notice.body, color=START, auto_close_seconds=_SECONDS)
