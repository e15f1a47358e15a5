"""What a place is found in again when a server opens it the next time."""

from dataclasses import dataclass

from nerfnav_app.places.vantage import View
from nerfnav_app.state.history import Moment


@dataclass(frozen=True)
class LeftOff:
    """How a place was left."""

    moment: Moment
    """What was asked for."""
    view: View | None = None
    """From where it was looked at; None where nobody has turned the camera."""
