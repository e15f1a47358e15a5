"""All experiments in one folder: each in a folder of its own, then a page that puts the numbers beside the paper's.

An experiment that cannot run here is an entry with its reason. The same command continues where it was interrupted.
"""

import time
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.experiments import Results, Row
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress, Remark
from nerfnav_app.jobs.measure.catalog import EXPERIMENTS, Experiment
from nerfnav_app.jobs.measure.claims import write_page
from nerfnav_app.jobs.measure.experiment import ExperimentRequest, Measured, measure, require_counts
from nerfnav_app.jobs.measure.manifest import Manifest, make_manifest, open_folder
from nerfnav_app.jobs.measure.results import save_results
from nerfnav_app.storage.output_files import OutputError, write_text

ALL = "all"
"""Name on the command line."""
PAGE = "results.md"
"""Page with the numbers beside the paper's: docs/results.md is one."""
_AT_ONCE_S = 0.2
"""Progress within this time comes from earlier runs, and tells nothing about the speed [s]."""


def run(request: ExperimentRequest) -> JobEvents:
    """Run all experiments; return trials, failures and times of each. Raises NerfnavError for bad requests."""
    if request.out is None:
        raise InvalidInputError("the experiments write into one folder: name it with --out, such as runs/all")
    if request.sweep or request.flights is not None or request.obstacles is not None:
        raise InvalidInputError(
            "all experiments run with their own settings: name one to sweep, to change flights, or to place obstacles"
        )
    require_counts(request)
    settings = {"quick": request.quick, "trials": request.trials, "seed": request.seed, "place": request.place}
    with open_folder(request.out, make_manifest(ALL, settings, {})) as manifest:
        found: dict[str, Measured | str] = {}
        clock = _Clock()
        for name, entry in EXPERIMENTS.items():
            events = _try(request, entry)
            while True:
                try:
                    event = next(events)
                except StopIteration as end:
                    found[name] = end.value
                    break
                yield clock.with_time_left(event, entry, found) if isinstance(event, Progress) else event
        return _finish(request.out, manifest, found)


def _try(request: ExperimentRequest, entry: Experiment) -> Generator[Progress | Remark, None, Measured | str]:
    """Run one experiment; return its results, or the reason why there are none."""
    assert request.out is not None
    own = replace(request, name=entry.name, out=request.out / entry.name)
    if entry.alone:
        own = replace(own, jobs=None, ray=None)
    if entry.own_worlds:
        own = replace(own, place=None)
    try:
        return (yield from measure(own))
    except OutputError:
        raise  # no experiment can write
    except NerfnavError as error:
        return str(error)
    except Exception as error:  # hours of other experiments are not lost by one
        return f"{type(error).__name__}: {error}"


def _finish(out: Path, manifest: Manifest, found: dict[str, Measured | str]) -> JobResult:
    """Write the results of all, and the page."""
    entries = {name: _numbers(measured) for name, measured in found.items()}
    total = sum(entry.get("wall_s", 0.0) for entry in entries.values())
    summary: Row = {"experiments": entries, "wall_s": total}
    rows = tuple({"experiment": name, "trials": 0, "failed": 0, "wall_s": 0.0, "cpu_s": 0.0, "skipped": ""} | entry
                 for name, entry in entries.items())  # fmt: skip
    files = save_results(out, ALL, Results(summary, rows), {})
    return JobResult(summary, (*files, write_text(out / PAGE, write_page(manifest, found))))


def _numbers(measured: Measured | str) -> Row:
    """Counts and times of an experiment: those of its trials, added up over all runs."""
    if isinstance(measured, str):
        return {"skipped": measured}
    walls, cpus = ([getattr(end, name) for end in measured.ends] for name in ("wall_s", "cpu_s"))
    return {"trials": len(measured.ends), "failed": measured.failed, "wall_s": sum(walls), "cpu_s": sum(cpus)}


class _Clock:
    """Clock of the series: time left, by the share of the work since its beginning."""

    def __init__(self) -> None:
        """Start it."""
        self._share = self._worked = self._work_s = 0.0
        self._last = time.monotonic()

    def with_time_left(self, event: Progress, entry: Experiment, found: dict[str, Measured | str]) -> Progress:
        """The progress of one experiment as that of all."""
        costs = {name: other.cost for name, other in EXPERIMENTS.items()}
        share = (sum(costs[name] for name in found) + event.fraction * entry.cost) / sum(costs.values())
        now = time.monotonic()
        if now - self._last > _AT_ONCE_S:
            self._worked, self._work_s = self._worked + share - self._share, self._work_s + now - self._last
        self._share, self._last = share, now
        left = ""
        if self._worked > 0:
            left = f", {max(1, round((1 - share) * self._work_s / self._worked / 60))} min left"
        return Progress(f"{len(found) + 1} of {len(costs)}, {entry.name}: {event.label}{left}", share)
