"""Next step: the action that a person most likely wants now, and the button that offers it."""


from collections.abc import Callable

import viser

from nerfnav.planner import CostWeights, PlanOutcome
from nerfnav_app.queries.more_time import MoreTimeQuery
from nerfnav_app.state.actions import Cancel, Command, StartFlight, StartPlan
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.records import AllowTime, RestoreWeights
from nerfnav_app.state.session import Session

NEXT = {JobKind.PLAN: "Plan the way", JobKind.FLY: "Fly it"}


def find_remedy(session: Session) -> tuple[Command, str] | None:
    """What helps against a plan that is not to be flown, and what to call it; None where the page cannot help."""
    plan = session.unsafe_plan
    if plan is None or session.job is not None:
        return None
    if plan.outcome is PlanOutcome.OVER_LIMITS:
        seconds = MoreTimeQuery.seconds_for(plan, session)
        return None if seconds is None else (AllowTime(seconds), f"Allow {seconds:.1f} s")
    return (RestoreWeights(), "Restore the weights") if plan.settings.weights != CostWeights() else None


def choose_next_step(session: Session) -> tuple[Command, str]:
    """What a person most likely wants now, and what to call it."""
    if session.job is not None and session.job.kind is not JobKind.OPEN:
        return Cancel(), "Stop now"
    plan = session.unsafe_plan
    if session.fresh_plan is not None or (plan is not None and plan.leads):
        return find_remedy(session) or (StartFlight(), NEXT[JobKind.FLY])
    return StartPlan(), NEXT[JobKind.PLAN]


_OFFERS: tuple[type[Command], ...] = (StartPlan, StartFlight, AllowTime, RestoreWeights, Cancel)
"""All that `choose_next_step` may offer."""


class NextButtons:
    """One button for each thing that may come next, of which one is shown.

    A press is under way for a while, longest beside a busy program, and means what its button said: who stops what has
    just ended must not begin what comes after it.
    """

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._buttons = {kind: _button(server, kind) for kind in _OFFERS}
        self._wanted: dict[type[Command], Command] = {}
        for kind, button in self._buttons.items():
            self._listen(kind, button, post)

    def _listen(
        self, kind: type[Command], button: viser.GuiButtonHandle, post: Callable[[Command], None]
    ) -> None:
        @button.on_click
        async def _(_: viser.GuiEvent) -> None:
            if kind in self._wanted:  # whoever presses what was never shown is no tab of ours
                post(self._wanted[kind])

    def show(self, session: Session, visible: bool) -> None:
        """Offer what comes next, if anything is to be offered."""
        command, label = choose_next_step(session)
        self._wanted[type(command)] = command
        for kind, button in self._buttons.items():
            button.visible = visible and kind is type(command)
        button = self._buttons[type(command)]
        button.label = label
        button.disabled = session.place is None or session.seeking


def _button(server: viser.ViserServer, kind: type[Command]) -> viser.GuiButtonHandle:
    """One of them, as it is until a session gives it its words: only the one to plan can be seen, greyed out."""
    words, first = NEXT[JobKind.PLAN], kind is StartPlan
    if kind is Cancel:
        return server.gui.add_button(words, icon=viser.Icon.PLAYER_STOP, color="gray", visible=False)
    return server.gui.add_button(words, icon=viser.Icon.PLAYER_PLAY, visible=first, disabled=first)
