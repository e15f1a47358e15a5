"""Status panel: the open place, the status line, and undo, redo and reset, always at the top.

The status line describes the work in progress, or how it ended.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import viser

from nerfnav.navigation import EpisodeOutcome, SupervisorState
from nerfnav.planner import planners
from nerfnav_app.page.kit.html import ROW, LegendEntry, caution, fine, heading, legend, note, warning
from nerfnav_app.page.kit.risk import look_of_risk
from nerfnav_app.page.kit.theme import BELIEF, GOAL, GUST, HIT, PLAN, START, TRUTH
from nerfnav_app.page.kit.widgets import confirm_reset, post_on
from nerfnav_app.page.panels.flight.flight import format_landing, has_arrived
from nerfnav_app.page.panels.flight.track import summarize_track as track_ended
from nerfnav_app.page.panels.plan.plan import (
    OLD,
    OLD_GOAL,
    explain_unsafe_plan,
    holds_old_goal,
    summarize_plan,
)
from nerfnav_app.page.panels.status.next_step import NextButtons
from nerfnav_app.places.ends import EndRole
from nerfnav_app.places.sources import title_of
from nerfnav_app.state.actions import Command, Redo, StartFlight, Undo
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.plan import DeclineFlight, PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.text import capital, format_wait, sentence


@dataclass(frozen=True)
class Status:
    """Text of the status line, and its format."""

    text: str
    """One or two sentences."""
    html: Callable[[str], str] = note
    """Format: a remark, good or bad news."""


def status(session: Session) -> Status:
    """Choose the status line: the last failure, else the work in progress, else its outcome, else the next action."""
    trouble, flight, plan = session.trouble, session.flight, session.plan
    if trouble is not None:
        return Status(f"{trouble.title}: {trouble.body}", warning)
    if session.job is not None or session.place is None:
        return Status(describe_activity(session))
    if session.alignment.is_moving:
        return Status("Turn the place as it belongs, then apply that. Start, goal and plans are hidden meanwhile.")
    if flight is not None and session.flight_is_shown and flight.outcome is not None:
        landed = describe_landing(flight)
        old = session.flight_outdated_by
        now = "A trained field has replaced the draft: plan and fly again. " if old == "field" else ""
        return Status(f"{now}{OLD} {old}: {landed}") if old else Status(landed, format_landing(flight))
    if session.track is not None and session.track.steps:
        located = session.track.steps[-1].tracked.status.knows
        return Status(f"{track_ended(session.track)}.", fine if located else warning)
    if session.outside:
        return Status(describe_outside(session), warning)
    problems = {which.value: text for which in EndRole if (text := session.problems.get(which)) is not None}
    if problems and session.place.robot.planar:  # which may fit, with nothing to stand on
        return Status(" ".join(map(sentence, problems.values())), warning)
    if problems:
        return Status(f"The robot does not fit at the {' and the '.join(problems)}: move it into free space.", warning)
    if session.drawing is not None:
        return Status("Click where the obstacle goes next. Esc ends its path, and the plan follows.")
    if needs_confirmation(session) and plan is not None:
        return Status(f"{explain_unsafe_plan(plan, session)} Fly anyway?", warning)
    if plan is not None and plan.latest is not None and not session.flight_is_shown:
        return _of_plan(plan, session)
    return Status("Move start and goal, plan, then fly.")


def describe_outside(session: Session) -> str:
    """Explain why the typed numbers of start or goal were rejected."""
    assert session.place is not None, "ends are typed in an open place"
    box, robot = session.place.field.box, session.place.robot
    texts = []
    for which, end in session.outside.items():
        at = ", ".join(f"{value:g}" for value in end.position)
        room = " and ".join(f"{axis} from {low:.2f} to {high:.2f}" for axis, low, high in end.misfits(box, robot))
        texts.append(f"The {which.value} cannot be at {at}: the robot is inside the place with {room} m.")
    return " ".join(texts)


def _of_plan(plan: PlanRecord, session: Session) -> Status:
    if session.plan_follows_hand:
        return Status("The plan follows the drag.")
    if session.plan_is_stale or plan.draft:
        if plan.refusal:
            return Status(f"No plan for this: {sentence(plan.refusal)}", warning)
        if planners.load(session.choice.planner).real_time:
            return Status("Planning again…")
        return Status("Ends, settings or the field have changed since this plan: plan again.", warning)
    if plan.is_unsafe:
        return Status(explain_unsafe_plan(plan, session), warning)
    if not plan.is_good:
        return Status("Planning was stopped before it finished: plan again.")
    risk = plan.collision_probability
    look = fine if risk is None else look_of_risk(risk).html
    return Status(summarize_plan(plan), caution if plan.is_blind and look is fine else look)


def describe_landing(flight: FlightRecord) -> str:
    """Describe how a flight ended, such as "Arrived after 2.4 s, 5 cm from the goal"."""
    last = flight.steps[-1]
    apart = (last.truth.position - flight.ends.goal.state().position).norm().item()
    far = f"{100 * apart:.0f} cm" if apart < 1 else f"{apart:.1f} m"
    hit = next((step.time for step in flight.steps if step.touched), last.time)
    arrived = "Arrived" if has_arrived(flight) else "Believes to have arrived"
    texts = {
        EpisodeOutcome.REACHED: f"{arrived} after {last.time:.1f} s, {far} from the goal",
        EpisodeOutcome.COLLIDED: f"Hit something at {hit:.1f} s, and ended {far} from the goal",
        EpisodeOutcome.OUTSIDE: f"Left the place at {last.time:.1f} s, {far} from the goal",
        EpisodeOutcome.LOST: f"Lost at {last.time:.1f} s, {far} from the goal",
        EpisodeOutcome.DIVERGED: f"Lost at {last.time:.1f} s, {far} from the goal: fly again with less noise",
        EpisodeOutcome.TIMEOUT: f"Not arrived after {last.time:.1f} s, {far} from the goal: allow more time",
        EpisodeOutcome.NO_PLAN: "Did not take off: no path to the goal was found",
        EpisodeOutcome.TOO_RISKY: "Did not take off: every path exceeds the accepted risk under this noise",
        EpisodeOutcome.STOPPED: f"Stopped at {last.time:.1f} s, {far} from the goal",
    }
    ended = texts[last.outcome or EpisodeOutcome.STOPPED]
    gust = f". {describe_gust(flight)}" if flight.gusts else ""
    return f"{ended}{gust}{_of_consistency(flight) or _of_search(flight)}"


def _of_search(flight: FlightRecord) -> str:
    """Describe why a robot was given up, as a further sentence; nothing where it was not."""
    changes = [step.change for step in flight.steps if step.change is not None]
    given_up = [change.reason for change in changes if change.after in (SupervisorState.LOST, SupervisorState.LANDING)]
    return f". {sentence(given_up[0])}" if given_up else ""


def _of_consistency(flight: FlightRecord) -> str:
    """Describe why the filter does not agree with its models, as a further sentence; nothing where it does."""
    monitor = flight.steps[-1].consistency
    return "" if monitor is None or monitor.sentence is None else f". {sentence(monitor.sentence)}"


def describe_gust(flight: FlightRecord) -> str:
    """Describe the last gust of a flight, such as "Gust of 0.12 m/s at 1.4 s: survived."."""
    pushed, last = flight.steps[flight.gusts[-1]], flight.steps[-1]
    which = f"Last of {len(flight.gusts)} gusts, of" if len(flight.gusts) > 1 else "Gust of"
    survived = last.outcome is None or not last.outcome.is_mishap
    later = "survived" if survived else f"{last.time - pushed.time:.1f} s before the end"
    return f"{which} {pushed.gust_mps:.2g} m/s at {pushed.time:.1f} s: {later}."


def needs_confirmation(session: Session) -> bool:
    """Check whether the user has to confirm the flight of a plan that is unsafe, or whose risk is high."""
    asked, doubtful = session.unconfirmed, session.doubtful_plan
    # a replay changes the record, not the plan
    return asked is not None and doubtful is not None and asked.latest is doubtful.latest


def describe_activity(session: Session) -> str:
    """Describe the work in progress in a line."""
    job = session.job
    if job is None:
        return "could not be opened"
    if job.paused:
        remark = f". {OLD_GOAL}" if holds_old_goal(session) else ""
        return f"Paused after time step {max(0, session.steps_reported - 1)}{remark}"
    if job.kind is JobKind.FLY and session.flight is not None and session.flight.steps:
        doing = f": {session.flight.doing}" if session.flight.doing else ""
        gust = f". {describe_gust(session.flight)}" if session.flight.gusts else ""
        return f"Flying, time step {session.steps_reported}{doing}{gust}{_of_consistency(session.flight)}"
    if job.kind is JobKind.TRACK and session.track is not None and session.track.steps:
        return f"Tracking, frame {len(session.track.steps)}: {job.label}"
    done = "" if job.fraction is None else f" {100 * job.fraction:.0f} %"
    default = {
        JobKind.OPEN: "Opening",
        JobKind.PLAN: "Planning",
        JobKind.FLY: "Planning the flight",
        JobKind.COMPARE: "Comparing",
        JobKind.EXPERIMENT: "Running the experiment",
        JobKind.FIND: "Localizing the robot",
        JobKind.MAP: "Making the map",
        JobKind.EXPORT: "Checking the trajectory",
        JobKind.PLACE: "Aligning the place",
        JobKind.TRACK: "Tracking the camera",
    }[job.kind]
    left = "" if job.left_s is None else f", about {format_wait(job.left_s)} left"
    planned = "; planning starts afterwards" if job.plan_after else ""
    return capital(job.label or default) + done + left + planned


_MEANINGS = (
    LegendEntry(START, "start"),
    LegendEntry(GOAL, "goal"),
    LegendEntry(PLAN, "plan"),
    LegendEntry(TRUTH, "executed path"),
    LegendEntry(BELIEF, "estimate, 95 % covariance"),
    LegendEntry(HIT, "collision"),
    LegendEntry(GUST, "gust"),
)


class StatusPanel:
    """Panel of the status: name of the place, status line, next command, undo, redo and reset."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._title = server.gui.add_html(heading("nerfnav"))
        self._status = server.gui.add_html("")
        self._next = NextButtons(server, post)
        self._anyway = server.gui.add_button("Fly anyway", color="red", visible=False)
        self._decline = server.gui.add_button("Do not fly", color="gray", visible=False)
        self._leave_out = server.gui.add_button("Leave it out", visible=False, hint="Open it without its stray parts")
        self._remedy: Command | None = None
        self._progress = server.gui.add_progress_bar(0.0, visible=False, animated=True)
        self._row = server.gui.add_html(ROW)
        self._undo, self._redo, self._reset = (
            server.gui.add_button(label, color="gray", hint=hint, disabled=True)
            for label, hint in (
                ("Undo", "Ctrl+Z: undo the last move or setting"), ("Redo", "Ctrl+Y: revert the last undo"),
                ("Reset", "Shift+R: discard plan, flight and all settings"),
            )
        )  # fmt: skip
        self._legend = server.gui.add_html(legend(_MEANINGS))
        post_on(self._undo.on_click, post, Undo)
        post_on(self._redo.on_click, post, Redo)
        self._post = post
        self._reset.on_click(self._ask_to_reset)
        post_on(self._anyway.on_click, post, lambda: StartFlight(anyway=True))
        post_on(self._decline.on_click, post, DeclineFlight)
        post_on(self._leave_out.on_click, post, lambda: self._remedy)

    async def _ask_to_reset(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            confirm_reset(event.client, self._post)

    def show(self, session: Session) -> None:
        """Show the place and the status."""
        job, now = session.job, status(session)
        self._title.content = heading(session.place.name if session.place is not None else title_of(session.what))
        self._status.content = now.html(now.text)
        self._progress.visible = job is not None and not job.paused
        self._progress.value = 100 * (job.fraction or 0.0) if job is not None else 0.0
        self._next.show(session, visible=not needs_confirmation(session))
        for button in (self._row, self._undo, self._redo, self._reset):
            button.visible = session.place is not None
        self._undo.disabled = not (session.history.past or session.alignment.past)
        self._redo.disabled = not session.history.future
        self._reset.disabled = session.place is None
        self._anyway.visible = self._decline.visible = needs_confirmation(session)
        self._remedy = None if session.trouble is None else session.trouble.remedy
        self._leave_out.visible = self._remedy is not None
