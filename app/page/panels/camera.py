"""A floating panel with what the robot sees, what it believes to see, and how these differ."""

import numpy as np
import viser

from app.page.html import note
from app.page.panels.camera_images import beside, difference, step_of, with_pixels
from app.state.queries import View
from app.state.records import FlightRecord
from app.state.session import Session

_WIDTH, _LEFT, _TOP = 460.0, 14.0, 14.0  # [pixels]
_FLYING = (
    "The robot's camera with the pixels that the filter compares (red: rejected), the field from where the robot "
    "believes to be, and their difference, three times as bright."
)
_FROM_THE_ENDS = "The field as the robot would see it from the start (left) and from the goal (right)."
_NOTHING = np.full((2, 4, 3), 30, np.uint8)


class CameraPanel:
    """Pictures of the flight, else of what waits at start and goal."""

    def __init__(self, server: viser.ViserServer) -> None:
        panel = server.gui.add_panel()
        with panel.add_tab("Camera", viser.Icon.CAMERA):
            self._picture = server.gui.add_image(_NOTHING, jpeg_quality=85, visible=False)
            self._caption = server.gui.add_html(note("Opening…"))
        panel.float(x=_LEFT, y=_TOP, width=_WIDTH)
        self._shown: tuple[int, int] | None = None

    def show(self, session: Session) -> None:
        """Show the last picture, once the field's answer to it is there."""
        view = session.view
        if view is None:
            return
        shown = id(view), session.steps_reported
        if self._shown == shown:
            return
        self._shown = shown
        caption, picture = compose(view, session.shown_flight)
        self._caption.content = note(caption)
        self._picture.image = picture
        self._picture.visible = True


def compose(view: View, flight: FlightRecord | None) -> tuple[str, np.ndarray]:
    """What the pictures are, and the pictures side by side."""
    step = step_of(view, flight)
    if step is None or step.image is None:
        return _FROM_THE_ENDS, beside(*view.images)
    seen, (believed, *_) = step.image.numpy(), view.images
    pictures = [with_pixels(seen, step.update), believed]
    if seen.shape == believed.shape:
        pictures.append(difference(seen, believed))
    return _FLYING, beside(*pictures)
