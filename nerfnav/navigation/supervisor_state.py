"""Supervisor states: what the supervisor does in a time step, the state that this belongs to, and changes of states."""

from dataclasses import dataclass
from enum import Enum
from typing import Any


class SupervisorState(Enum):
    """State of the supervisor after a time step; the value is what a user reads."""

    TRACKING = "pictures agree with the belief, and the robot follows its plan"
    BLIND = "the picture says too little for where the robot may be: it holds, looks around, or goes back to its view"
    SEARCHING = "the belief is not trusted: the robot holds and is searched for everywhere"
    LOST = "the robot was searched for in vain: it comes to rest"
    LANDING = "the robot was searched for in vain: it lands on the ground below"
    ENDED = "the flight is over"


class SupervisorAction(Enum):
    """Action of the supervisor in a time step, None while nothing is wrong; the value is what a user reads."""

    WIDENED = "the picture disagreed: the belief was widened, and the robot holds"
    BLIND = "the picture says too little for where the robot may be: it holds and looks around"
    ADRIFT = "the robot may be anywhere near, and was looked for everywhere and not found: it holds and looks around"
    SEARCHED = "the robot was looked for everywhere and not found: it holds and looks around"
    BACKUP = "the plan was no longer safe: the robot comes to rest in free space"
    RELOCALISED = "the robot was lost, and found again by looking everywhere"
    LOST = "the robot was lost, and not found again"
    LANDED = "the robot was lost: it lands on the ground below"

    @property
    def state(self) -> SupervisorState:
        """State that the action belongs to."""
        return _STATES.get(self, SupervisorState.TRACKING)

    @property
    def holds(self) -> bool:
        """Check whether the robot does not follow a plan to its goal, for lack of a position or of a safe plan."""
        return self.doubts or self is SupervisorAction.BACKUP

    @property
    def doubts(self) -> bool:
        """Check whether the robot holds because it does not know its position."""
        return self.state is not SupervisorState.TRACKING

    @property
    def turns(self) -> bool:
        """Check whether the robot turns while it holds, because its present view does not help."""
        return self in (SupervisorAction.BLIND, SupervisorAction.ADRIFT, SupervisorAction.SEARCHED)


_STATES = {
    SupervisorAction.WIDENED: SupervisorState.SEARCHING,
    SupervisorAction.BLIND: SupervisorState.BLIND,
    SupervisorAction.ADRIFT: SupervisorState.SEARCHING,
    SupervisorAction.SEARCHED: SupervisorState.SEARCHING,
    SupervisorAction.LOST: SupervisorState.LOST,
    SupervisorAction.LANDED: SupervisorState.LANDING,
}


def state_after(action: SupervisorAction | None) -> SupervisorState:
    """Return the state after an action; None is the action while nothing is wrong."""
    return SupervisorState.TRACKING if action is None else action.state


@dataclass(frozen=True)
class StateChange:
    """Change of the supervisor's state in a time step."""

    step: int
    """Index of the time step."""
    before: SupervisorState
    """State until then."""
    after: SupervisorState
    """State from then on."""
    reason: str
    """Condition that held, with its numbers."""

    def to_json(self) -> dict[str, str | int]:
        """Encode the change, as `nerfnav fly --json` prints it."""
        before, after = self.before.name.lower(), self.after.name.lower()
        return {"step": self.step, "from": before, "to": after, "reason": self.reason}

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> "StateChange":
        """Decode what `to_json` returns."""
        before, after = (SupervisorState[content[name].upper()] for name in ("from", "to"))
        return cls(int(content["step"]), before, after, str(content["reason"]))
