"""Putting a place right as a job of the worker: each result has a folder of its own, until the app ends."""

import tempfile
from pathlib import Path

from nerfnav_app.jobs.events import JobEvents
from nerfnav_app.state.job import Job
from nerfnav_app.state.session import Session


class PlacedFiles:
    """Fields of places that were put right; one can go back to all that were before."""

    def __init__(self) -> None:
        """Nothing is on disk before the first one."""
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def begin(self, session: Session, job: Job) -> JobEvents:
        """The events of a job that puts the session's place right; it keeps its name."""
        from nerfnav_app.jobs import place_field  # slow to import, and seldom needed

        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True)
        out = Path(self._folder.name) / str(job.id) / f"{Path(session.what).stem}.npz"
        return place_field.run(place_field.PlaceRequest(session.what, session.placing.correction(), out))
