"""Experiment job: many trials, a table, figures, and the numbers that sum them up.

catalog.py lists the experiments. The folder of each holds

    manifest.json   settings, inputs and code: what a run that continues must have in common (manifest.py)
    results.jsonl   a line for each trial that has ended, with its seed; a failed one with its reason (TrialEnd)
    results.json    summary, table, median and percentiles
    NAME.csv        the table; table.md: summary, median and percentiles for readers
    *.png, *.svg    the figures
"""

from collections.abc import Callable, Generator, Mapping
from contextlib import nullcontext
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, UseAppendAction, arg

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import map_steps
from nerfnav.experiments import (
    FlightOptions,
    Journal,
    Results,
    Row,
    Study,
    TrialDone,
)
from nerfnav.experiments.study import TrialEnd, require_numbers
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress, Remark
from nerfnav_app.jobs.measure.arena import open_arena
from nerfnav_app.jobs.measure.catalog import EXPERIMENTS, Experiment
from nerfnav_app.jobs.measure.manifest import TRIALS, Manifest, make_manifest, open_folder
from nerfnav_app.jobs.measure.report import write_replays
from nerfnav_app.jobs.measure.results import write_folder
from nerfnav_app.jobs.measure.sweep import combine, label_of, merge, parse_sweeps
from nerfnav_app.places.place import field_file
from nerfnav_app.storage.output_files import OutputError
from nerfnav_scenes import tasks_of


@dataclass(frozen=True)
class ExperimentOptions:
    """Name, trials and place of an experiment. The command line reads them as they are."""

    name: Annotated[Positional[str], arg(help=f"Name: {', '.join(EXPERIMENTS)}, or all.")]
    trials: int | None = None
    """Number of trials (default: by the experiment)."""
    jobs: int | None = None
    """Trials at the same time (default: 1)."""
    ray: Annotated[str | None, arg(metavar="ADDRESS")] = None
    """Ray cluster for the trials: auto, local, ray://HOST:PORT."""
    seed: int = 0
    """Seed of everything random."""
    place: Annotated[str | None, arg(metavar="NAME|FILE")] = None
    """Scene or field file (default: the experiment's own scene)."""
    obstacles: Annotated[Path | None, arg(metavar="FILE")] = None
    """Obstacles that stand in the place, in YAML or JSON, as with `plan`."""
    out: Path | None = None
    """Folder for manifest, trials, results, tables and figures. The same command continues an experiment that was
    interrupted."""
    quick: bool = False
    """A small number of trials, stated in the results."""
    sweep: Annotated[tuple[tuple[str, ...], ...], UseAppendAction, arg(metavar="SETTING=A,B,...")] = ()
    """Repeat the experiment with each value of a setting, in one table: risk-weight=0.3,1,3. Several settings: each
    combination."""


@dataclass(frozen=True)
class ExperimentRequest(ExperimentOptions):
    """Request of an experiment; what it has done so far is in results.jsonl in `out`, None writes nothing."""

    flights: FlightOptions | None = None
    """Options of the experiment on whole flights; None: its own, and for all others."""


@dataclass(frozen=True)
class Measured:
    """Results of an experiment, with what they come from."""

    summary: Row
    """Its numbers."""
    files: tuple[Path, ...]
    """Files that were written."""
    ends: tuple[TrialEnd, ...]
    """Its trials, those of earlier runs too."""
    manifest: Manifest | None
    """Manifest of the folder; None without one."""

    @property
    def failed(self) -> int:
        """Number of trials that failed."""
        return sum(end.failed is not None for end in self.ends)


def run(request: ExperimentRequest) -> JobEvents:
    """Yield how far it is; return the summary and what was written. Raises NerfnavError for bad requests."""
    measured = yield from measure(request)
    return JobResult(measured.summary, measured.files)


def measure(request: ExperimentRequest) -> Generator[Progress | Remark, bool | None, Measured]:
    """Do what `run` does, and return the trials too."""
    experiment = EXPERIMENTS[request.name]
    swept = combine(parse_sweeps([word for words in request.sweep for word in words]))
    require_counts(request)
    request = replace(request, trials=experiment.quick if request.quick else request.trials)
    variants = [_Variant(experiment, _with(request, known, experiment), known) for known in swept]
    out = request.out
    manifest = None if out is None else _manifest_of(request, variants)
    ends: list[TrialEnd] = []
    with nullcontext() if out is None or manifest is None else open_folder(out, manifest) as begun:
        yield Progress("opening the field", 0.0)
        if out is not None and Journal(out / TRIALS).drop_cut_line():
            yield Remark(f"dropped the last line of {out / TRIALS}, which was cut: its trial is done again")
        found: list[Results] = []
        for index, variant in enumerate(variants):
            step = partial(_progress, ends, index, len(variants))
            found.append((yield from _with_trials_that_worked(variant, ends, step)))
        results = merge(swept, found, experiment.headline) if swept != [{}] else found[0]
        if failures := [_failure(end) for end in ends if end.failed is not None]:
            results = replace(results, summary={**results.summary, "failed": failures})
        files: tuple[Path, ...] = ()
        if out is not None:
            results, files = write_folder(out, experiment.name, experiment.purpose, results)
            files = (*files, *write_replays(out, results.replays))
        return Measured(results.summary, files, tuple(ends), begun)


def require_counts(request: ExperimentOptions) -> None:
    """Raise InvalidInputError for a request with two numbers of trials, or with a number that no experiment takes."""
    require_numbers(request.trials, request.jobs, request.seed)
    if request.quick and request.trials is not None:
        raise InvalidInputError("--quick sets the number of trials: drop it, or drop --trials")


@dataclass(frozen=True)
class _Variant:
    """One combination of a sweep, or the whole experiment without one."""

    experiment: Experiment
    request: ExperimentRequest
    known: dict[str, Any]
    """Settings of the combination."""

    @property
    def places(self) -> tuple[str, ...]:
        """Places of the trials; with obstacles one alone, as they stand in that."""
        if self.request.place is not None:
            return (self.request.place,)
        beside = self.experiment.beside if self.request.obstacles is None else ()
        return (self.experiment.place, *beside)

    @property
    def flights(self) -> FlightOptions:
        """Options of whole flights."""
        return self.request.flights or self.experiment.flights or FlightOptions()

    def study(self) -> Study:
        """Open the first place, and make the study of all places."""
        request, (place, *further) = self.request, self.places
        open_here = partial(open_arena, place, request.obstacles)
        study = Study(
            open_here, self.experiment.tasks_in(place, open_here()), request.trials, request.seed, request.jobs,
            request.ray, self.flights, self._journal(place),
        )  # fmt: skip
        beside = [
            replace(study, open_arena=partial(open_arena, name), tasks=tasks_of(name), journal=self._journal(name))
            for name in further
        ]
        return replace(study, beside=tuple(beside))

    def _journal(self, place: str) -> Journal | None:
        out = self.request.out
        return None if out is None else Journal(out / TRIALS, place, label_of(self.known))


def _with(request: ExperimentRequest, known: Mapping[str, Any], experiment: Experiment) -> ExperimentRequest:
    """The request with the settings of a combination. Raises InvalidInputError for options that it does not take."""
    if experiment.own_worlds and (request.place or known.get("place")) is not None:
        raise InvalidInputError(f"the experiment {request.name} flies in worlds of its own: leave out --place")
    if experiment.own_worlds and request.obstacles is not None:
        raise InvalidInputError(f"the experiment {request.name} has obstacles of its own: leave out --obstacles")
    if experiment.alone and (request.ray is not None or request.jobs not in (None, 1)):
        raise InvalidInputError(
            f"the experiment {request.name} measures times, so nothing runs beside it: leave out --jobs and --ray"
        )
    options = {option.name for option in fields(FlightOptions)}
    of_flights = {name: value for name, value in known.items() if name in options}
    if (of_flights or request.flights is not None) and experiment.flights is None:
        flying = ", ".join(name for name, other in EXPERIMENTS.items() if other.flights is not None)
        raise InvalidInputError(f"the experiment {request.name} takes no options of whole flights, only {flying} do")
    if of_flights:
        given = request.flights or experiment.flights or FlightOptions()
        request = replace(request, flights=replace(given, **of_flights))
    return replace(request, **{name: value for name, value in known.items() if name not in options})


def _manifest_of(request: ExperimentRequest, variants: list[_Variant]) -> Manifest:
    robots = {variant.flights.robot for variant in variants}
    files = {place: field_file(place) for variant in variants for place in variant.places}
    files |= {robot: Path(robot) for robot in robots if robot is not None and Path(robot).is_file()}
    flights = {} if request.flights is None else asdict(request.flights)
    settings = {"trials": request.trials, "seed": request.seed, "place": request.place, **flights}
    if request.obstacles is not None:
        settings["obstacles"] = str(request.obstacles)
        files[str(request.obstacles)] = request.obstacles
    sweep = {"sweep": [label_of(variant.known) for variant in variants]} if variants[0].known else {}
    return make_manifest(request.name, settings | sweep, files)


def _with_trials_that_worked(
    variant: _Variant, ends: list[TrialEnd], step: Callable[[TrialDone], Progress]
) -> Generator[Progress, bool | None, Results]:
    """Run a variant. Raises InvalidInputError where all trials failed, OutputError where the disk takes no more."""
    try:
        results = yield from map_steps(variant.experiment.run(variant.study()), step)
    except OSError as error:
        raise OutputError(f"cannot write {variant.request.out}: {error.strerror}") from error
    except (ValueError, ArithmeticError, LookupError, TypeError) as error:  # summaries of no trial at all
        _require_one_that_worked(ends, error)
        raise
    _require_one_that_worked(ends)
    return results


def _require_one_that_worked(ends: list[TrialEnd], cause: Exception | None = None) -> None:
    reasons = [end.failed for end in ends]
    if reasons and None not in reasons:
        raise InvalidInputError(f"none of {len(reasons)} trials worked: {reasons[0]}") from cause


def _progress(ends: list[TrialEnd], index: int, count: int, step: TrialDone) -> Progress:
    ends += step.ended
    return Progress(f"{step.label}, {step.done} of {step.total}", (index + step.done / max(1, step.total)) / count)


def _failure(end: TrialEnd) -> Row:
    setting = {"setting": end.setting} if end.setting else {}
    return {"place": end.place, **setting, "work": end.work, "trial": end.trial, "seed": end.seed, "reason": end.failed}
