"""A flight as one HTML file that needs neither server nor network: the place, the flight, a timeline.

replay.html is the page; what it shows is put in its place as JSON:

    title, robot, dt [s], outcome, extents [m]
    steps: for each time truth and belief as (position [m], R_world_body row by row), the 95 % ellipsoid as the
        matrix that makes it of the unit ball, the plan's positions, and the numbers of the step
    surface: the place's surface, thinned (nerfnav.export.surface)
"""

import json
from importlib.resources import files

from nerfnav.core.errors import InvalidInputError
from nerfnav.export.recording import Exported, Recording
from nerfnav.export.replay_data import replay_data

_PLACE = "/*REPLAY*/null"


def replay(recording: Recording) -> Exported:
    """The page. Raises InvalidInputError for a plan, which has nothing to replay."""
    if not recording.steps:
        raise InvalidInputError("only flights can be replayed: fly the plan first")
    page = (files("nerfnav.export") / "replay.html").read_text(encoding="utf-8")
    # a name that holds "</script>" must not end the script
    data = json.dumps(replay_data(recording), allow_nan=False).replace("<", "\\u003c")
    pictures = sum(step.image is not None for step in recording.steps)
    info = {"steps": len(recording.steps), "pictures": pictures, "has_surface": recording.surface is not None}
    return Exported(page.replace(_PLACE, data, 1).encode(), info)
