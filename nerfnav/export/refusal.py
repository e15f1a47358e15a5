"""Refusal of an export: what is not exported, why, and what helps."""

from dataclasses import dataclass
from enum import Enum

from nerfnav.core.errors import InvalidInputError
from nerfnav.export.recording import Subject


class Remedy(Enum):
    """Remedy for a refused export; the value is the advice of the command line."""

    PLAN = "export the plan (--of plan)"
    SMOOTH = "smooth it (--smooth)"
    REPLAN = "plan with more room or time"
    FORCE = "export it by force (--force)"


@dataclass(frozen=True)
class Refusal:
    """Refusal of an export, for a person to read and for a page to act on."""

    subject: Subject
    """Subject that is not exported."""
    format: str
    """Name of the format."""
    why: str
    """Reason, a part of a sentence."""
    remedies: tuple[Remedy, ...]
    """Remedies, the best one first."""

    @property
    def reason(self) -> str:
        """Subject, format and reason, without the remedies."""
        return f"{self.subject.title} is not exported for {self.format}: {self.why}"

    def __str__(self) -> str:
        """Reason and remedies in one sentence."""
        return f"{self.reason}; {', or '.join(remedy.value for remedy in self.remedies)}"


class ExportRefusedError(InvalidInputError):
    """Error: the export is refused, because it is not safe to fly."""

    def __init__(self, refusal: Refusal) -> None:
        """Keep the refusal for readers that act on it."""
        super().__init__(str(refusal))
        self.refusal = refusal


class NoCurveError(InvalidInputError):
    """Error: no smooth curve is near enough to the rows and within the robot's limits."""
