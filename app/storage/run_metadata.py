"""Run metadata: all that is known of a flight besides its steps (run.json), written at take-off and again at the
end."""

import json
import math
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from nerfnav.core.errors import InvalidInputError, first_line
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.storage.output_files import json_line, write_text

FILE = "run.json"
FORMAT, VERSION = "nerfnav run", 1
_INTERRUPTED = "interrupted"
_SAME_M = 1e-3


@dataclass(frozen=True)
class RunMetadata:
    """Metadata of a flight: place, robot, settings and outcome."""

    place: str
    """Name of the place."""
    source: str
    """What was opened: scene name or field file."""
    robot: str
    """Its name, or its file."""
    planner: str
    estimator: str
    seed: int
    dt: float
    """Length of a time step [s]."""
    ends: Ends
    """Start and goal."""
    task: str | None = None
    """The scene's task; None where the ends were chosen freely."""
    open_loop: bool = False
    unknown: str = "occupied"
    """What planners took unproven space for."""
    date: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))
    """When it took off, UTC."""
    outcome: str | None = None
    """How it ended; None while it flies, and for ever where the program was killed."""
    plan_outcome: str | None = None
    """Outcome of its first plan; None where that is not known."""
    command: str | None = None
    """Command line that flies it again, as a person would type it; None in files of versions that did not keep it."""
    requests: tuple[str, ...] = ()
    """Requests of the operator on the way, without which the command flies."""
    metrics: dict[str, Any] = field(default_factory=dict)
    """The numbers of the flight, as `nerfnav fly --json` prints them."""

    def save(self, folder: Path) -> Path:
        """Write the metadata to run.json."""
        return write_text(folder / FILE, json_line({"format": FORMAT, "version": VERSION, **asdict(self)}) + "\n")

    def with_goal(self, goal: End) -> "RunMetadata":
        """The same flight; with another goal than it began with it is that of no task."""
        if math.dist(goal.position, self.ends.goal.position) < _SAME_M:
            return self
        return replace(self, ends=Ends(self.ends.start, goal), task=None)

    @classmethod
    def load(cls, folder: Path) -> "RunMetadata":
        """Read run.json. Raises InvalidInputError where it is missing or holds something else."""
        try:
            content = json.loads((folder / FILE).read_text())
            if (content.pop("format"), content.pop("version")) != (FORMAT, VERSION):
                raise ValueError("it is of another format")
            about = msgspec.convert(content, cls)
            ends = (about.ends.start, about.ends.goal)
            if not all(math.isfinite(number) for end in ends for number in (*end.position, end.yaw, about.dt)):
                raise ValueError("a number of its ends, or its dt, is not finite")
            return about
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            reason = f"it has no {error}" if isinstance(error, KeyError) else first_line(error)
            raise InvalidInputError(
                f"{FILE} of {folder.name} is no readable {FORMAT} of version {VERSION}: {reason}"
            ) from error


@dataclass(frozen=True)
class StoredRun:
    """Entry of the run store: one stored flight."""

    name: str
    """Of its folder."""
    metadata: RunMetadata
    steps: int
    """Time steps flown, the start not counted."""
    flying: bool = False
    """Whether it is being written now."""

    @property
    def outcome(self) -> str:
        """Outcome, in one word."""
        return "flying" if self.flying else self.metadata.outcome or _INTERRUPTED
