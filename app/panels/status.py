"""What is open and what is happening, always at the top."""

import viser

from app.session import JobKind, Session
from app.sources import title_of
from app.theme import BELIEF, GOAL, HIT, PLAN, START, TRUTH
from app.widgets import heading, legend, warning

_MEANINGS = (
    (START, "start"),
    (GOAL, "goal"),
    (PLAN, "plan"),
    (TRUTH, "true path"),
    (BELIEF, "estimate, 95 % covariance"),
    (HIT, "hit"),
)


class StatusPanel:
    """The place's name, the job in progress, and the last thing that went wrong."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._title = server.gui.add_html(heading("nerfnav", "…"))
        self._progress = server.gui.add_progress_bar(0.0, visible=False, animated=True)
        self._legend = server.gui.add_html(legend(_MEANINGS))
        self._trouble = server.gui.add_html("", visible=False)

    def show(self, session: Session) -> None:
        """Say what is open and what is being done."""
        job = session.job
        name = session.place.name if session.place is not None else title_of(session.what)
        self._title.content = heading(name, activity(session))
        self._progress.visible = job is not None and not job.paused
        self._progress.value = 100 * (job.fraction or 0.0) if job is not None else 0.0
        trouble = session.trouble
        self._trouble.visible = trouble is not None
        if trouble is not None:
            self._trouble.content = warning(f"{trouble.title}: {trouble.body}")


def activity(session: Session) -> str:
    """One line on what the app is doing."""
    job = session.job
    if job is None:
        if session.place is None:
            return "could not be opened"
        return "Move start and goal, plan, then fly."
    if job.paused:
        return f"Paused after time step {max(0, session.steps_reported - 1)}"
    if job.kind is JobKind.FLY and session.flight is not None and session.flight.steps:
        doing = f": {session.flight.doing}" if session.flight.doing else ""
        return f"Time step {session.steps_reported}{doing}"
    percent = "" if job.fraction is None else f" {100 * job.fraction:.0f} %"
    default = {JobKind.OPEN: "Opening", JobKind.PLAN: "Planning", JobKind.FLY: "Planning the flight"}[job.kind]
    return (job.label.capitalize() or default) + percent
