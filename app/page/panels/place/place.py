"""Place panel: open a place, select the training quality and the robot."""

from collections.abc import Callable

import numpy as np
import viser

import nerfnav_scenes as scenes
from nerfnav import robots
from nerfnav.importers import drop_answered_guesses
from nerfnav_app.page.kit.html import note
from nerfnav_app.page.kit.widgets import ChoiceList, post_on
from nerfnav_app.places.derived import describe_unproven_in
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.places.place import Place
from nerfnav_app.places.sources import BUDGETS_S, SUFFIXES, QualityName, title_of
from nerfnav_app.places.uploads import UploadError
from nerfnav_app.queries.better_field import BetterFieldQuery
from nerfnav_app.queries.place_list import PlaceListQuery
from nerfnav_app.state.actions import Cancel, ChooseQuality, Command, Notify, OpenPlace
from nerfnav_app.state.session import Session
from nerfnav_app.text import format_wait

_DRAFT = (
    "This field is a draft, learned in seconds. While its capture is open, it is learned further: fly by camera after "
    "that."
)
_LONGER = 280
"""Longer side of the picture of a field in training [pixels]."""
_NOTHING = np.full((2, 4, 3), 30, np.uint8)


class PlacePanel:
    """Panel of the places and the robots."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None], library: PlaceLibrary) -> None:
        """Add the widgets; `post` takes the commands, `library` stores uploads."""
        self._post, self._library = post, library
        self._session: Session | None = None
        self._bundled = {name: name for name in scenes.with_fields()}
        self._kept: dict[str, str] = {}
        self._opened: dict[str, str] = {}
        self._known: dict[str, str] = {}
        self._places: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
            "Place", list[str](self._bundled), hint="Bundled worlds and files that were opened"
        )
        post_on(self._places.on_update, post, self._chosen)
        self._upload = server.gui.add_upload_button(
            "Open a file",
            color="gray",
            icon=viser.Icon.UPLOAD,
            mime_type=",".join(SUFFIXES),
            hint="A field, a mesh (glb, obj, ...), Gaussian splats (ply, spz, sog, ...), a zip of a capture, a video",
        )
        self._upload.on_upload(self._take)
        self._quality: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
            "Training quality", tuple(_QUALITIES), hint="Of meshes and captures; other files open without training"
        )
        self._progress = server.gui.add_html("", visible=False)
        self._stop = server.gui.add_button("Stop opening", color="gray", icon=viser.Icon.X, visible=False)
        self._doubts = server.gui.add_html("", visible=False)
        self._picture = server.gui.add_image(_NOTHING, label="Learned so far", jpeg_quality=85, visible=False)
        self._pictured: np.ndarray | None = None
        known = (*robots.names(), *map(str, library.robots.files()))
        self._robots = ChoiceList(server, "robot", known, "Body and dynamics", post)
        post_on(self._quality.on_update, post, lambda: ChooseQuality(_QUALITIES[self._quality.value]))
        post_on(self._stop.on_click, post, Cancel)

    def _chosen(self) -> OpenPlace | None:
        what = self._known.get(self._places.value)  # empty before the first session is shown
        if what is None or self._session is None or what == self._session.what:
            return None
        return OpenPlace(what)

    def _take(self, event: viser.GuiEvent) -> None:
        """Store the upload and open it; runs on a thread of the server's pool."""
        upload = self._upload.value
        try:
            self._post(OpenPlace(str(self._library.keep(upload.name, upload.content))))
        except UploadError as error:
            self._post(Notify("Not opened", str(error), bad=True))

    def show(self, session: Session) -> None:
        """Show the open place and the selected robot."""
        self._session = session
        self._list(session)
        self._quality.value = _label(session.quality)
        self._progress.visible = session.place is None
        self._progress.content = note(describe_opening(session))
        self._stop.visible = session.place is None and session.before is not None
        better = BetterFieldQuery.result_in(session)
        left_s = None if better is None else better.left_s
        doubts = "" if session.place is None else describe_doubts(session.place, left_s)
        self._doubts.visible = doubts != ""
        if doubts:
            self._doubts.content = note(doubts)
        self._show_picture(picture_of_training(session))
        self._robots.show(session)

    def _show_picture(self, picture: np.ndarray | None) -> None:
        """Show a picture of the field in training, and hide the last one once there is none."""
        if picture is not None and picture is not self._pictured:
            self._picture.image = _enlarged(picture)
        self._pictured, self._picture.visible = picture, picture is not None

    def _list(self, session: Session) -> None:
        """List the places that were opened, and the one that is being opened."""
        listed = PlaceListQuery.result_in(session)
        if listed is not None:
            self._kept = {entry.name: entry.what for entry in listed}
        here = next((name for name, what in self._kept.items() if what == session.what), title_of(session.what))
        if session.place is not None and session.what not in (*self._bundled.values(), *self._kept.values()):
            self._opened[here] = session.what
        opened = {name: what for name, what in self._opened.items() if what not in self._kept.values()}
        self._known = {**self._bundled, **self._kept, **opened, here: session.what}
        if self._places.options != tuple(self._known):
            self._places.options = tuple(self._known)
        self._places.value = here


def _enlarged(picture: np.ndarray) -> np.ndarray:
    """Scale a picture (h, w, 3) so that its longer side has `_LONGER` pixels."""
    height, width, _ = picture.shape
    scale = _LONGER / max(height, width)
    size = max(1, round(scale * width)), max(1, round(scale * height))
    from PIL import Image  # slow to import

    return np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.BILINEAR))


def picture_of_training(session: Session) -> np.ndarray | None:
    """Find the last picture of a field that is learned, before the place opens or after; None without training."""
    if session.place is None:
        return None if session.job is None else session.job.picture
    better = BetterFieldQuery.result_in(session)
    return None if better is None else better.picture


def describe_doubts(place: Place, left_s: float | None = None) -> str:
    """Describe a draft, what is unproven in a place, and a guess of up, which is to be looked at.

    A draft is trained further for `left_s`, without the time of plans and flights.
    """
    left = "" if left_s is None else f" About {format_wait(left_s)} left."
    draft = _DRAFT + left if place.field.info.is_draft else ""
    guesses = place.field.info.guesses
    guessed = len(drop_answered_guesses(guesses, ("up",))) < len(guesses)
    turn = 'Its up is a guess: where it lies wrong, turn it under "Turn, scale, crop".' if guessed else ""
    return " ".join(text for text in (draft, describe_unproven_in(place), turn) if text)


def describe_opening(session: Session) -> str:
    """Describe the progress of opening a place, and the time left."""
    job = session.job
    if job is None:
        return f"{title_of(session.what)} could not be opened."
    left = "" if job.left_s is None else f" About {format_wait(job.left_s)} left."
    return f"Opening {title_of(session.what)}: {job.label[:1].lower()}{job.label[1:]}.{left}"


def _label(quality: QualityName) -> str:
    """Format a quality with its training time."""
    return f"{quality}: about {format_wait(BUDGETS_S[quality])}"


_QUALITIES: dict[str, QualityName] = {_label(quality): quality for quality in BUDGETS_S}
