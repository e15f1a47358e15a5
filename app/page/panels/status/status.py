"""Status panel: the open place, the status line, and undo, redo and reset, always at the top.

The status line tells in plain words what is being done, or how it ended.
"""


from collections.abc import Callable
from dataclasses import dataclass

import viser

from nerfnav.navigation import EpisodeOutcome
from nerfnav.planner import planners
from nerfnav_app.page.kit.html import fine, heading, legend, note, warning
from nerfnav_app.page.kit.theme import BELIEF, GOAL, HIT, PLAN, START, TRUTH
from nerfnav_app.page.panels.flight.track import summarize_track as track_ended
from nerfnav_app.page.panels.plan.plan import explain_unsafe_plan, summarize_plan
from nerfnav_app.page.panels.status.next_step import NextButtons
from nerfnav_app.places.ends import EndRole
from nerfnav_app.places.sources import title_of
from nerfnav_app.state.actions import Command, Redo, Reset, StartFlight, Undo
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.records import DeclineFlight, FlightRecord, PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.text import capital, sentence


@dataclass(frozen=True)
class Status:
    """What the status line says."""

    text: str
    """One or two sentences."""
    html: Callable[[str], str] = note
    """As what it is shown: a quiet remark, good or bad news."""


def status(session: Session) -> Status:
    """What matters most: what is being done, else what went wrong, else how it ended, else what to do."""
    trouble, flight, plan = session.trouble, session.flight, session.plan
    if trouble is not None:
        return Status(f"{trouble.title}: {trouble.body}", warning)
    if session.job is not None or session.place is None:
        return Status(describe_activity(session))
    if flight is not None and session.flight_is_shown and flight.outcome is not None:
        return Status(describe_landing(flight), fine if flight.outcome is EpisodeOutcome.REACHED else warning)
    if session.track is not None and session.track.steps:
        known = session.track.steps[-1].tracked.status.knows
        return Status(f"{track_ended(session.track)}.", fine if known else warning)
    if session.outside:
        return Status(outside(session), warning)
    blocked = [which.value for which in EndRole if session.problems.get(which) is not None]
    if blocked:
        return Status(f"The robot does not fit at the {' and the '.join(blocked)}: move it into free space.", warning)
    if asks(session) and plan is not None:
        return Status(f"{explain_unsafe_plan(plan, session)} Fly it all the same?", warning)
    if plan is not None and plan.latest is not None and not session.flight_is_shown:
        return _of_plan(plan, session)
    return Status("Move start and goal, plan, then fly.")


def outside(session: Session) -> str:
    """What is wrong with the numbers of start or goal that were typed and not taken."""
    assert session.place is not None, "ends are typed in an open place"
    box, margin = session.place.field.box, session.place.robot.body.radius
    told = []
    for which, end in session.outside.items():
        at = ", ".join(f"{value:g}" for value in end.position)
        room = " and ".join(f"{axis} from {low:.2f} to {high:.2f}" for axis, low, high in end.misfits(box, margin))
        told.append(f"The {which.value} cannot be at {at}: the robot is inside the place with {room} m.")
    return " ".join(told)


def _of_plan(plan: PlanRecord, session: Session) -> Status:
    if session.plan_follows_hand:
        return Status("The plan follows your hand.")
    if session.plan_is_stale or plan.draft:
        if plan.refusal:
            return Status(f"No plan for this: {sentence(plan.refusal)}", warning)
        if planners.load(session.choice.planner).real_time:
            return Status("Planning again…")
        return Status("Something was changed since this plan was made: plan again.", warning)
    if plan.is_unsafe:
        return Status(explain_unsafe_plan(plan, session), warning)
    return Status(summarize_plan(plan), fine) if plan.is_good else Status("Planning was stopped too early: plan again.")


def describe_landing(flight: FlightRecord) -> str:
    """How a flight ended, such as "Arrived after 2.4 s, 5 cm from the goal"."""
    last = flight.steps[-1]
    apart = (last.truth.position - flight.ends.goal.state().position).norm().item()
    far = f"{100 * apart:.0f} cm" if apart < 1 else f"{apart:.1f} m"
    hit = next((step.time for step in flight.steps if step.touched), last.time)
    words = {
        EpisodeOutcome.REACHED: f"Arrived after {last.time:.1f} s, {far} from the goal",
        EpisodeOutcome.COLLIDED: f"Hit something at {hit:.1f} s; the flight ended {far} from the goal",
        EpisodeOutcome.DIVERGED: f"Lost at {last.time:.1f} s: the robot did not know where it was, {far} from the goal",
        EpisodeOutcome.TIMEOUT: f"Not arrived after {last.time:.1f} s: {far} from the goal",
        EpisodeOutcome.NO_PLAN: "Did not take off: no way to the goal was found",
        EpisodeOutcome.TOO_RISKY: "Did not take off: no way was found that is safe enough in the noise to come",
        EpisodeOutcome.STOPPED: f"Stopped at {last.time:.1f} s, {far} from the goal",
    }
    return words[last.outcome] if last.outcome is not None else words[EpisodeOutcome.STOPPED]


def asks(session: Session) -> bool:
    """Whether a person is asked if a plan is to be flown though it is not safe."""
    return session.doubt is not None and session.doubt is session.unsafe_plan


def describe_activity(session: Session) -> str:
    """One line on what the app is doing."""
    job = session.job
    if job is None:
        return "could not be opened"
    if job.paused:
        return f"Paused after time step {max(0, session.steps_reported - 1)}"
    if job.kind is JobKind.FLY and session.flight is not None and session.flight.steps:
        doing = f": {session.flight.doing}" if session.flight.doing else ""
        return f"Flying, time step {session.steps_reported}{doing}"
    if job.kind is JobKind.TRACK and session.track is not None and session.track.steps:
        return f"Tracking, frame {len(session.track.steps)}: {job.label}"
    done = "" if job.fraction is None else f" {100 * job.fraction:.0f} %"
    default = {
        JobKind.OPEN: "Opening",
        JobKind.PLAN: "Planning",
        JobKind.FLY: "Planning the flight",
        JobKind.COMPARE: "Comparing",
        JobKind.EXPERIMENT: "Doing the experiment",
        JobKind.FIND: "Looking for the robot",
        JobKind.MAP: "Making the map",
        JobKind.EXPORT: "Judging what is to be flown",
        JobKind.PLACE: "Putting the place right",
        JobKind.TRACK: "Tracking the camera",
    }[job.kind]
    planned = "; then the way is planned" if job.plan_after else ""
    return capital(job.label or default) + done + planned


_MEANINGS = (
    (START, "start"),
    (GOAL, "goal"),
    (PLAN, "plan"),
    (TRUTH, "true path"),
    (BELIEF, "estimate, 95 % covariance"),
    (HIT, "hit"),
)
_CHANGES: dict[str, Command] = {"Undo": Undo(), "Redo": Redo(), "Reset": Reset()}


class StatusPanel:
    """The place's name, one line on what is done or how it ended, and the button for what comes next."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._title = server.gui.add_html(heading("nerfnav"))
        self._status = server.gui.add_html("")
        self._next = NextButtons(server, post)
        self._anyway = server.gui.add_button("Fly all the same", color="red", visible=False)
        self._stay = server.gui.add_button("Do not fly", color="gray", visible=False)
        self._progress = server.gui.add_progress_bar(0.0, visible=False, animated=True)
        self._back = server.gui.add_button_group("Changes", tuple(_CHANGES), hint="Ctrl+Z, Ctrl+Y, shift+R")
        self._legend = server.gui.add_html(legend(_MEANINGS))

        @self._back.on_click
        async def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                post(_CHANGES[event.target.value])

        @self._anyway.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(StartFlight(anyway=True))

        @self._stay.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(DeclineFlight())

    def show(self, session: Session) -> None:
        """Say what is open and what is being done."""
        job, now = session.job, status(session)
        self._title.content = heading(session.place.name if session.place is not None else title_of(session.what))
        self._status.content = now.html(now.text)
        self._progress.visible = job is not None and not job.paused
        self._progress.value = 100 * (job.fraction or 0.0) if job is not None else 0.0
        self._next.show(session, visible=not asks(session))
        self._back.visible = session.place is not None
        self._anyway.visible = self._stay.visible = asks(session)
