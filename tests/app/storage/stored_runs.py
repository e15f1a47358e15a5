"""Shelves with flights on them, as the fly job writes them."""

from collections.abc import Sequence
from pathlib import Path

from nerfnav.navigation.episode import Episode, NavigationStep
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.storage.run_metadata import RunMetadata
from nerfnav_app.storage.run_store import RunStore
from nerfnav_app.storage.step_log import open_step_log
from tests.export.flights import flown

ENDS = Ends(End((1.0, 0.0, 0.3), 3.0), End((0.0, 0.9, 0.5)))


def about(place: str = "balls", **changes: object) -> RunMetadata:
    """What is known of a flight at take-off."""
    known = {"source": place, "robot": "quadrotor", "planner": "fast", "estimator": "paper", "seed": 3}
    return RunMetadata(**{"place": place, "dt": 0.1, "ends": ENDS} | known | changes)  # type: ignore[arg-type]


def put(shelf: RunStore, name: str, steps: Sequence[NavigationStep] | None = None, **changes: object) -> Path:
    """Put a flight on the shelf."""
    folder = shelf.folder / name
    folder.mkdir(parents=True)
    with open_step_log(folder, about(**changes), Episode.metrics) as log:  # type: ignore[arg-type]
        assert log is not None
        for step in flown() if steps is None else steps:
            log.append(step)
    return folder
