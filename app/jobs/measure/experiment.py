"""Experiment job: many trials, a table, figures, and the numbers that sum them up; and the registry of experiments.

A new experiment is a file in nerfnav/experiments and an entry in EXPERIMENTS. The folder of each holds

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
from nerfnav.core.registry import Registry
from nerfnav.core.steps import map_steps
from nerfnav.experiments import (
    Arena,
    ExperimentSteps,
    FlightOptions,
    Journal,
    Results,
    Row,
    Study,
    TrialDone,
    basin,
    closed_loop,
    correlation,
    estimation,
    ground_robots,
    planners,
    reflight,
    relocalisation,
    replanning,
    tangent,
)
from nerfnav.experiments.rivals import experiment as rivals
from nerfnav.experiments.study import TrialEnd, require_numbers
from nerfnav.world import Task
from nerfnav_app.benchmarks import timing
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress, Remark
from nerfnav_app.jobs.measure.arena import open_arena
from nerfnav_app.jobs.measure.manifest import TRIALS, Manifest, make_manifest, open_folder
from nerfnav_app.jobs.measure.report import write_replays
from nerfnav_app.jobs.measure.results import write_folder
from nerfnav_app.jobs.measure.sweep import combine, label_of, merge, parse_sweeps
from nerfnav_app.places.place import field_file
from nerfnav_app.storage.output_files import OutputError
from nerfnav_scenes import tasks_of
from nerfnav_scenes.tasks import stonehenge


@dataclass(frozen=True)
class Experiment:
    """Entry of the registry of experiments."""

    name: str
    """Name on the command line."""
    run: Callable[[Study], ExperimentSteps]
    """Function that runs it."""
    purpose: str
    """Purpose, for the user."""
    place: str = "stonehenge"
    """Default place: name of a scene, or path of a field."""
    tasks: tuple[Task, ...] | None = None
    """Flights in that place; None: those of its scene."""
    beside: tuple[str, ...] = ()
    """Further scenes that it happens in where no place is asked for."""
    flights: FlightOptions | None = None
    """Options of whole flights where none are given; None: it takes none."""
    quick: int = 2
    """Trials of `--quick`."""
    cost: float = 10.0
    """CPU time of these trials [s], about: its share of the progress of all experiments."""
    alone: bool = False
    """It measures times, so nothing runs beside it: neither --jobs nor --ray."""
    headline: tuple[str, ...] = ()
    """Numbers of its summary that the figure of a sweep shows; none: the first three."""

    def tasks_in(self, place: str, arena: Arena) -> tuple[Task, ...]:
        """Its own flights where it happens in its own place, else those of the scene."""
        own = self.tasks if place == self.place else None
        return arena.scene.tasks if own is None else own


EXPERIMENTS: Registry[Experiment] = Registry("experiment", (
    Experiment(
        "planners",
        planners.run,
        "nerfnav, minimum snap and RRT on the same flights: collision cost, effort, failures",
        tasks=stonehenge.EXPERIMENT_TASKS,
        quick=10,
        cost=5,
        headline=("nerfnav.failures", "nerfnav.collision_mean", "nerfnav.effort_mean"),
    ),
    Experiment(
        "flights",
        closed_loop.run,
        "whole flights by camera, of the tasks and between random ends: how many arrive, errors, honesty, times",
        flights=FlightOptions(),
        quick=10,
        cost=20,
        headline=("reached", "collided", "position_median_m", "step_p50_ms"),
    ),
    Experiment(
        "replanning",
        replanning.run,
        "the same first plans in closed loop by camera and in open loop, under the same noise: how many arrive",
        place="playground",
        beside=("stonehenge", "church", "apartment"),
        flights=FlightOptions("tasks", fly_on=True),
        quick=5,
        cost=45,
        headline=("together.closed.reached", "together.open.reached", "together.closed.cost_ratio_median"),
    ),
    Experiment(
        "timing",
        timing.run,
        "plan, replan, filter and covariance: times printed in the paper, its way on this machine, and nerfnav",
        quick=1,
        cost=20,
        alone=True,
    ),
    Experiment(
        "rivals",
        rivals.run,
        "other people's planners beside nerfnav's on the same pairs of ends: clean flights, times, cost",
        beside=("playground", "church"),
        quick=4,
        cost=10,
        headline=("methods.nerfnav.clean", "methods.nerfnav.J_median", "methods.nerfnav.time_p50_ms"),
    ),
    Experiment(
        "collision-correlation",
        correlation.run,
        "collision loss in the field against true overlap, over the iterations of plans",
        place="playground",
        quick=5,
        cost=2,
        headline=("spearman_median", "final_overlaps"),
    ),
    Experiment(
        "ground-robots",
        ground_robots.run,
        "a couch that must turn to pass a gap, and wheels that never slide: overlap, lateral velocity",
        place="church",
        quick=10,
        cost=12,
        headline=("couch_touched", "couch_held_touched", "wheel_lateral_speed_max_mps"),
    ),
    Experiment(
        "estimation",
        estimation.run,
        "the pose filter against iNeRF on the same disturbed flights: errors, honesty",
        tasks=stonehenge.EXPERIMENT_TASKS[:10],
        quick=5,
        cost=8,
        headline=("methods.nerfnav.position_rmse_m", "methods.inerf.position_rmse_m", "nees_mean"),
    ),
    Experiment(
        "relocalisation",
        relocalisation.run,
        "finding a camera anywhere in the place from one picture: how often, how sure, how fast",
        quick=10,
        cost=25,
    ),
    Experiment(
        "basin",
        basin.run,
        "from how far off one picture leads the pose filter back",
        tasks=stonehenge.EXPERIMENT_TASKS[:10],
        quick=5,
        cost=3,
    ),
    Experiment(
        "tangent-plane",
        tangent.run,
        "Adam in the tangent of the last state against a single tangent plane: convergence (paper Eq. 8)",
        quick=3,
        cost=18,
    ),
    Experiment(
        "reflight",
        reflight.run,
        "exports flown again by RotorPy and Mellinger's controller: clean on the mesh, tracking errors",
        beside=("playground", "church"),
        quick=2,
        cost=15,
    ),
))  # fmt: skip
"""Name to experiment."""


def register(experiment: Experiment) -> None:
    """Make an experiment known by its name. Raises NameTakenError where another one has it."""
    EXPERIMENTS.register(experiment)


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
        """Places of the trials."""
        if self.request.place is not None:
            return (self.request.place,)
        return (self.experiment.place, *self.experiment.beside)

    @property
    def flights(self) -> FlightOptions:
        """Options of whole flights."""
        return self.request.flights or self.experiment.flights or FlightOptions()

    def study(self) -> Study:
        """Open the first place, and make the study of all places."""
        request, (place, *further) = self.request, self.places
        open_here = partial(open_arena, place)
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
