"""Table of stored flights: order, filter, colours by outcome, and the same rows as a CSV file."""

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from nerfnav.navigation import EpisodeOutcome, NavigateConfig
from nerfnav_app.page.kit.data_table import Column, Row, Text, data_table
from nerfnav_app.page.kit.theme import BELIEF, HIT, STALE, START, Rgb
from nerfnav_app.page.kit.widgets import format_name
from nerfnav_app.storage.run_metadata import StoredRun
from nerfnav_app.text import number

CUSTOM = "custom"
"""Task of a flight between ends that were chosen freely."""
ANY = "all"
"""Filter that lets everything through."""
_DATE = 16  # characters of a date to the minute
_GOOD = EpisodeOutcome.REACHED.name.lower()
_BAD = {outcome.name.lower() for outcome in EpisodeOutcome if outcome.is_mishap}
_FLYING = "flying"


@dataclass(frozen=True)
class SortKey:
    """Order of flights by one of their facts."""

    name: str
    """For the user."""
    of: Callable[[StoredRun], Any]
    """Reads the fact; None where it is unknown."""
    descending: bool = False
    """True if the largest comes first."""


def final_error(entry: StoredRun) -> float | None:
    """Read the distance between the robot and the goal at the end [m]; None while it flies."""
    return entry.metadata.metrics.get("final_position_error_m")


SORT_KEYS = {
    key.name: key
    for key in (
        SortKey("date", lambda entry: entry.metadata.date, descending=True),
        SortKey("place", lambda entry: entry.metadata.place),
        SortKey("task", lambda entry: entry.metadata.task or CUSTOM),
        SortKey("robot", lambda entry: format_name(entry.metadata.robot)),
        SortKey("outcome", lambda entry: entry.outcome),
        SortKey("steps", lambda entry: entry.steps),
        SortKey("final error", final_error),
    )
}
"""Name to order, the first is the usual one."""


@dataclass(frozen=True)
class Listing:
    """Choice of the listed flights and of their order."""

    outcome: str = ANY
    place: str = ANY
    sort: str = "date"
    """One of SORT_KEYS."""
    reverse: bool = False
    """Against the usual order of that key."""

    def sorted_by(self, name: str) -> "Listing":
        """Sort by a key; by the present one in reverse."""
        return Listing(self.outcome, self.place, name, not self.reverse if name == self.sort else False)

    def of(self, entries: Iterable[StoredRun]) -> tuple[StoredRun, ...]:
        """Select and sort flights; those without a value come last."""
        kept = [
            entry
            for entry in entries
            if self.outcome in (ANY, entry.outcome) and self.place in (ANY, entry.metadata.place)
        ]
        key = SORT_KEYS[self.sort]
        known = [entry for entry in kept if key.of(entry) is not None]
        unknown = [entry for entry in kept if key.of(entry) is None]
        return (*sorted(known, key=key.of, reverse=key.descending != self.reverse), *unknown)


def color_of(entry: StoredRun) -> Rgb:
    """Choose the colour of an outcome: good only where the robot is at the goal, not where it believes to be."""
    if entry.outcome == _GOOD:
        error = final_error(entry)
        return START if error is None or error <= NavigateConfig.goal_tolerance_m else BELIEF
    if entry.outcome == _FLYING:
        return STALE
    return HIT if entry.outcome in _BAD else BELIEF


def format_outcome(outcome: str) -> str:
    """Format an outcome for the user."""
    return outcome.replace("_", " ")


def runs_table(entries: Sequence[StoredRun], selected: str, listing: Listing, picks: str) -> str:
    """Format listed flights as a table in HTML; a click on a head sorts, one on a row selects."""

    pairs = (("date", "robot"), ("place", "task"), ("outcome", "steps"))
    columns = [Column([_title(name, listing) for name in pair]) for pair in pairs]
    columns.append(Column((_title("final error", listing),), number=True))
    return data_table(columns, [_row(entry, selected) for entry in entries], picks)


SORT = "sort:"
"""Beginning of a pick that sorts; others are names of flights."""


def _title(name: str, listing: Listing) -> Text:
    arrow = ""
    if name == listing.sort:
        arrow = " ↓" if SORT_KEYS[name].descending != listing.reverse else " ↑"
    return Text(name.capitalize() + arrow, pick=SORT + name, hint=f"Sort by {name}")


def _row(entry: StoredRun, selected: str) -> Row:
    about, error = entry.metadata, final_error(entry)
    cells = (
        (Text(about.date[:_DATE].replace("T", " "), hint=entry.name), Text(format_name(about.robot), muted=True)),
        (Text(about.place), Text(about.task or CUSTOM, muted=True)),
        (Text(format_outcome(entry.outcome), color_of(entry)), Text(str(entry.steps), muted=True)),
        (Text("–" if error is None else number(100 * error, "cm", digits=2)),),
    )
    return Row(cells, entry.name, entry.name == selected)


_CSV = (
    "name", "date_utc", "place", "task", "robot", "planner", "estimator", "seed", "outcome", "steps", "dt_s",
    "final_error_m",
)  # fmt: skip


def runs_csv(entries: Iterable[StoredRun]) -> str:
    """Write flights as CSV, one a row, with a head; unknown values are empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_CSV)
    for entry in entries:
        about, error = entry.metadata, final_error(entry)
        writer.writerow((
            entry.name, about.date, about.place, about.task or "", format_name(about.robot), about.planner,
            about.estimator, about.seed, entry.outcome, entry.steps, about.dt, "" if error is None else error,
        ))  # fmt: skip
    return text.getvalue()
