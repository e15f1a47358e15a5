"""Camera panel: the robot's picture, the field rendered from the estimated pose, and the difference times three."""

import numpy as np
import viser

from nerfnav.estimator import FilterStep
from nerfnav.importers import read_picture
from nerfnav.navigation import NavigationStep
from nerfnav_app.page.kit.theme import BELIEF, HIT
from nerfnav_app.queries.robot_view import RobotView, RobotViewQuery
from nerfnav_app.state.session import Session
from nerfnav_app.state.tracks import FrameRecord

_GAP = 6  # [pixels] between two pictures
_DARK = 30  # level of grey of the gap
_AMPLIFIED = 3  # differences of a good estimate are a few levels of grey


def beside(*images: np.ndarray) -> np.ndarray:
    """Join pictures (h, w, 3) side by side, padded to the highest."""
    height = max(image.shape[0] for image in images)
    columns = [
        np.pad(image, ((0, height - image.shape[0]), (0, _GAP), (0, 0)), constant_values=_DARK) for image in images
    ]
    return np.concatenate(columns, axis=1)[:, :-_GAP]


def difference(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Compute the difference of two pictures (h, w, 3) of bytes at each pixel, amplified three times."""
    apart = np.abs(one.astype(np.int16) - other.astype(np.int16)).max(-1, keepdims=True)
    return np.broadcast_to(np.minimum(255, _AMPLIFIED * apart), one.shape).astype(np.uint8)


def with_pixels(image: np.ndarray, update: FilterStep | None) -> np.ndarray:
    """Mark in a picture (h, w, 3) the pixels that the filter compared, its outliers in red."""
    if update is None or len(update.pixels) == 0:
        return image
    marked = image.copy()
    height, width, _ = image.shape
    columns, rows = update.pixels.numpy().astype(int).T
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    believed = np.ones(len(rows), bool) if update.believed is None else update.believed.numpy()
    for chosen, color in ((believed, BELIEF), (~believed, HIT)):
        marked[rows[inside & chosen], columns[inside & chosen]] = color
    return marked


_FLYING = "camera · field at estimate · difference × 3"
_FROM_THE_ENDS = "field at start · at goal"
_NOTHING = np.full((2, 4, 3), 30, np.uint8)


class CameraPanel:
    """Panel of the flight's pictures, else of the field seen from start and goal, outside of the scene.

    The folder hides them; a click opens them large.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._folder = server.gui.add_folder("Camera", visible=False)
        with self._folder:
            self._picture = server.gui.add_image(_NOTHING, label=_FROM_THE_ENDS, jpeg_quality=85)
        self._shown: tuple[RobotView | FrameRecord, int] | None = None

    def show(self, session: Session) -> None:
        """Show the last picture, once the field is rendered for it."""
        if session.place is None:  # pictures of the last place do not show the one that is being opened
            self._folder.visible, self._shown = False, None
        track = session.shown_track
        if track is not None and track.steps:
            self._show_frame(track.steps[-1])
            return
        query, view = RobotViewQuery.asked_in(session), RobotViewQuery.result_in(session)
        if query is None or view is None:
            return
        steps = session.steps_reported
        if self._shown is not None and self._shown[0] is view and self._shown[1] == steps:
            return
        self._shown = view, steps
        self._picture.label, self._picture.image = compose(view, query.step_of(session.shown_flight))
        self._folder.visible = True

    def _show_frame(self, frame: FrameRecord) -> None:
        """Show a frame of a track."""
        if self._shown is None or self._shown[0] is not frame:
            self._shown = frame, 0
            self._picture.label, self._picture.image = _FLYING, tracked_pictures(frame)
            self._folder.visible = True


def tracked_pictures(frame: FrameRecord) -> np.ndarray:
    """Join the picture of a track's frame, the field rendered from its pose, where known, and their difference."""
    seen = read_picture(frame.seen).pixels
    believed = np.zeros_like(seen) if frame.shown is None else read_picture(frame.shown).pixels
    return beside(seen, believed, difference(seen, believed))


def compose(view: RobotView, step: NavigationStep | None) -> tuple[str, np.ndarray]:
    """Return the caption and the joined pictures of a view; `step` is its time step, None at the ends."""
    if step is None or step.image is None:
        return _FROM_THE_ENDS, beside(*view)
    seen, (believed, *_) = step.image.numpy(), view
    pictures = [with_pixels(seen, None if step.update is None else step.update.step), believed]
    if seen.shape == believed.shape:
        pictures.append(difference(seen, believed))
    return _FLYING, beside(*pictures)
