"""Screenshot panel: download a picture of the scene."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from nerfnav.geometry import encode_image
from nerfnav_app.page.kit.theme import night
from nerfnav_app.state.actions import Command, Notify
from nerfnav_app.state.session import Session

SIZES = {"1280 × 720": (1280, 720), "1920 × 1080": (1920, 1080), "3840 × 2160": (3840, 2160)}
"""Width and height of screenshots [pixels]."""
_RENDER_TIMEOUT_S = 30.0


class ScreenshotPanel:
    """Panel of screenshots, drawn by the tab that requests them."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes messages to the user."""
        self._server, self._post = server, post
        self._session: Session | None = None
        self._size: viser.GuiDropdownHandle[str] = server.gui.add_dropdown("Picture size", list(SIZES))
        self._shot = server.gui.add_button("Screenshot", icon=viser.Icon.CAMERA, hint="The scene as you see it now")
        self._shot.on_click(self._shoot)

    def show(self, session: Session) -> None:
        """Remember the place: it names the file."""
        self._session = session

    def _shoot(self, event: viser.GuiEvent[Any]) -> None:
        """Let the tab draw its scene at the selected size; runs on a thread of the server's pool."""
        client, size = event.client, SIZES.get(str(self._size.value))
        if client is None or size is None:
            return
        width, height = size
        try:
            picture = client.get_render(height, width, transport_format="png", timeout=_RENDER_TIMEOUT_S)
        except TimeoutError:
            self._post(Notify("No screenshot", f"The page did not draw it within {_RENDER_TIMEOUT_S:g} s.", bad=True))
            return
        except RuntimeError:  # the page could not draw it, or was closed or reloaded before it had
            if client.client_id in self._server.get_clients():
                self._post(Notify("No screenshot", "The page could not draw it.", bad=True))
            return
        name = self._session.place.name if self._session is not None and self._session.place is not None else "nerfnav"
        client.send_file_download(f"{name}-{width}x{height}.png", png(picture), save_immediately=True)


def png(picture: np.ndarray) -> bytes:
    """Encode sRGB bytes (h, w, 3), or (h, w, 4) with opacity over the page's backdrop, as a PNG file."""
    colors = picture[..., :3]
    if picture.shape[-1] == 4:
        share = picture[..., 3:] / 255
        colors = np.round(share * colors + (1 - share) * night(len(picture))[:, :1]).astype(np.uint8)
    return encode_image(colors)
