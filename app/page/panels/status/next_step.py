"""Next step: the most likely command of the user, and the button that offers it."""

from collections.abc import Callable
from functools import partial

import viser

from nerfnav.planner import PlanOutcome
from nerfnav_app.page.kit.widgets import post_on
from nerfnav_app.queries.following_plan import MoreTimeQuery
from nerfnav_app.state.actions import Cancel, Command, StartFlight, StartPlan
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.plan import AllowTime, RestoreWeights
from nerfnav_app.state.session import Session

NEXT = {JobKind.PLAN: "Plan trajectory", JobKind.FLY: "Fly"}


def find_remedy(session: Session) -> tuple[Command, str] | None:
    """Find the command that mends an unsafe plan, with its label; None where the page has none."""
    plan = session.unsafe_plan
    if plan is None or session.job is not None:
        return None
    if plan.outcome is PlanOutcome.OVER_LIMITS:
        seconds = MoreTimeQuery.result_for(plan, session)
        return None if seconds is None else (AllowTime(seconds), f"Allow {seconds:.1f} s")
    return (RestoreWeights(), "Restore the weights") if not plan.settings.has_default_cost else None


def choose_next_step(session: Session) -> tuple[Command, str]:
    """Choose the most likely command of the user, with its label."""
    if session.job is not None and session.job.kind is not JobKind.OPEN:
        return Cancel(), "Stop now"
    plan = session.unsafe_plan
    if session.fresh_plan is not None or (plan is not None and plan.leads):
        return find_remedy(session) or (StartFlight(), NEXT[JobKind.FLY])
    return StartPlan(), NEXT[JobKind.PLAN]


_OFFERS: tuple[type[Command], ...] = (StartPlan, StartFlight, AllowTime, RestoreWeights, Cancel)
"""Commands that `choose_next_step` may offer."""


class NextButtons:
    """Buttons of the possible next commands, of which one is shown.

    A click takes a while to arrive, and means the label at that time: a click on Stop must not start the next job where
    the last one has just ended.
    """

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._buttons = {kind: _button(server, kind) for kind in _OFFERS}
        self._wanted: dict[type[Command], Command] = {}
        for kind, button in self._buttons.items():
            # a click on a button that was never shown is not from our page
            post_on(button.on_click, post, partial(self._wanted.get, kind))

    def show(self, session: Session, visible: bool) -> None:
        """Show the button of the next command, if any."""
        command, label = choose_next_step(session)
        self._wanted[type(command)] = command
        for kind, button in self._buttons.items():
            button.visible = visible and kind is type(command)
        button = self._buttons[type(command)]
        button.label = label
        waits = session.seeking or (session.alignment.is_moving and not isinstance(command, Cancel))
        button.disabled = session.place is None or waits


def _button(server: viser.ViserServer, kind: type[Command]) -> viser.GuiButtonHandle:
    """Add one of them as it is before the first session: only the one to plan is visible, disabled."""
    label, first = NEXT[JobKind.PLAN], kind is StartPlan
    if kind is Cancel:
        return server.gui.add_button(label, icon=viser.Icon.PLAYER_STOP, color="gray", visible=False)
    return server.gui.add_button(label, icon=viser.Icon.PLAYER_PLAY, visible=first, disabled=first)
