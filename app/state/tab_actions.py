"""Actions of the tabs of browsers: from where their people look, and that they go."""

from dataclasses import dataclass

from nerfnav_app.places.vantage import View
from nerfnav_app.state.view_settings import Eye


@dataclass(frozen=True)
class Looked:
    """The camera of a tab has moved."""

    client: int
    """Which tab."""
    eye: Eye


@dataclass(frozen=True)
class Viewed:
    """Somebody has turned the camera, and let it rest."""

    view: View


@dataclass(frozen=True)
class Left:
    """A tab was closed."""

    client: int


TabAction = Looked | Viewed | Left
