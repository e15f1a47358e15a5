"""What is open and what is happening, always at the top."""

from collections.abc import Callable

import viser

from app.page.html import heading, legend, warning
from app.page.theme import BELIEF, GOAL, HIT, PLAN, START, TRUTH
from app.places.sources import title_of
from app.state.actions import Cancel, Command, StartFlight, StartPlan
from app.state.job import JobKind
from app.state.session import Session
from app.text import capital

_MEANINGS = (
    (START, "start"),
    (GOAL, "goal"),
    (PLAN, "plan"),
    (TRUTH, "true path"),
    (BELIEF, "estimate, 95 % covariance"),
    (HIT, "hit"),
)
_NEXT = {JobKind.PLAN: "Plan the way", JobKind.FLY: "Fly it"}


class StatusPanel:
    """The place's name, the job in progress, and the last thing that went wrong."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._title = server.gui.add_html(heading("nerfnav", "…"))
        self._next = server.gui.add_button(_NEXT[JobKind.PLAN], icon=viser.Icon.PLAYER_PLAY, disabled=True)
        self._wanted: Command = StartPlan()
        self._progress = server.gui.add_progress_bar(0.0, visible=False, animated=True)
        self._legend = server.gui.add_html(legend(_MEANINGS))
        self._trouble = server.gui.add_html("", visible=False)

        @self._next.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(self._wanted)

    def show(self, session: Session) -> None:
        """Say what is open and what is being done."""
        job = session.job
        name = session.place.name if session.place is not None else title_of(session.what)
        self._title.content = heading(name, activity(session))
        self._progress.visible = job is not None and not job.paused
        self._progress.value = 100 * (job.fraction or 0.0) if job is not None else 0.0
        self._wanted, self._next.label = next_step(session)
        self._next.disabled = session.place is None or session.seeking
        self._next.color = "gray" if isinstance(self._wanted, Cancel) else None
        trouble = session.trouble
        self._trouble.visible = trouble is not None
        if trouble is not None:
            self._trouble.content = warning(f"{trouble.title}: {trouble.body}")


def next_step(session: Session) -> tuple[Command, str]:
    """What a person most likely wants now, and what to call it."""
    if session.job is not None and session.job.kind is not JobKind.OPEN:
        return Cancel(), "Stop now"
    if session.fresh_plan is not None:
        return StartFlight(), _NEXT[JobKind.FLY]
    return StartPlan(), _NEXT[JobKind.PLAN]


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
    default = {
        JobKind.OPEN: "Opening",
        JobKind.PLAN: "Planning",
        JobKind.FLY: "Planning the flight",
        JobKind.COMPARE: "Comparing",
        JobKind.EXPERIMENT: "Doing the experiment",
        JobKind.FIND: "Looking for the robot",
        JobKind.MAP: "Making the map",
        JobKind.PLACE: "Putting the place right",
    }[job.kind]
    return capital(job.label or default) + percent
