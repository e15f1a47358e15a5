"""Experiment job: many trials, a table, figures, and the numbers that sum them up; and the registry of experiments.

A new experiment is a file in nerfnav/experiments and an entry in EXPERIMENTS.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from nerfnav import __version__
from nerfnav.core.errors import InvalidInputError, MissingExtraError
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
from nerfnav.world import Task
from nerfnav_app.benchmarks import timing
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.measure.arena import open_arena
from nerfnav_app.jobs.measure.results import png_of, save_results
from nerfnav_app.storage.output_files import prepare_folder
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
    ),
    Experiment(
        "flights",
        closed_loop.run,
        "whole flights by camera, of the tasks and between random ends: how many arrive, errors, honesty, times",
        flights=FlightOptions(),
    ),
    Experiment(
        "replanning",
        replanning.run,
        "the same first plans in closed loop by camera and in open loop, under the same noise: how many arrive",
        place="playground",
        beside=("stonehenge", "church", "apartment"),
        flights=FlightOptions("tasks", fly_on=True),
    ),
    Experiment(
        "timing",
        timing.run,
        "plan, replan, filter and covariance: times printed in the paper, its way on this machine, and nerfnav",
    ),
    Experiment(
        "collision-correlation",
        correlation.run,
        "collision loss in the field against true overlap, over the iterations of plans",
        place="playground",
    ),
    Experiment(
        "ground-robots",
        ground_robots.run,
        "a couch that must turn to pass a gap, and wheels that never slide: overlap, lateral velocity",
        place="church",
    ),
    Experiment(
        "estimation",
        estimation.run,
        "the pose filter against iNeRF on the same disturbed flights: errors, honesty",
        tasks=stonehenge.EXPERIMENT_TASKS[:10],
    ),
    Experiment(
        "relocalisation",
        relocalisation.run,
        "finding a camera anywhere in the place from one picture: how often, how sure, how fast",
    ),
    Experiment(
        "basin",
        basin.run,
        "from how far off one picture leads the pose filter back",
        tasks=stonehenge.EXPERIMENT_TASKS[:10],
    ),
    Experiment(
        "tangent-plane",
        tangent.run,
        "Adam in the tangent of the last state against a single tangent plane: convergence (paper Eq. 8)",
    ),
    Experiment(
        "reflight",
        reflight.run,
        "exports flown again by RotorPy and Mellinger's controller: clean on the mesh, tracking errors",
        beside=("playground", "church"),
    ),
))  # fmt: skip
"""Name to experiment."""


def register(experiment: Experiment) -> None:
    """Make an experiment known by its name. Raises NameTakenError where another one has it."""
    EXPERIMENTS.register(experiment)


@dataclass(frozen=True)
class ExperimentOptions:
    """Name, trials and place of an experiment. The command line reads them as they are."""

    name: Annotated[Positional[str], arg(help=f"Name: {', '.join(EXPERIMENTS)}.")]
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
    """Folder for results.json, the table as CSV and the figures as PNG. The same command continues an experiment that
    was interrupted."""


@dataclass(frozen=True)
class ExperimentRequest(ExperimentOptions):
    """Request of an experiment; what it has done so far is in trials.jsonl in `out`, None writes nothing."""

    flights: FlightOptions | None = None
    """Options of the experiment on whole flights; None: its own, and for all others."""


def run(request: ExperimentRequest) -> JobEvents:
    """Yield how far it is; return the summary and what was written. Raises NerfnavError for bad requests."""
    experiment = EXPERIMENTS[request.name]
    if request.flights is not None and experiment.flights is None:
        flying = ", ".join(name for name, other in EXPERIMENTS.items() if other.flights is not None)
        raise InvalidInputError(f"the experiment {request.name} takes no options of whole flights, only {flying} do")
    out = None if request.out is None else prepare_folder(request.out)
    yield Progress("opening the field", 0.0)
    place = request.place or experiment.place
    open_here = partial(open_arena, place)
    tasks = experiment.tasks_in(place, open_here())
    about = f"{request.name}, seed {request.seed}, {request.flights}, {__version__}, in"
    journal = None if out is None else Journal(out / "trials.jsonl", f"{about} {place}")
    study = Study(
        open_here, tasks, request.trials, request.seed, request.jobs, request.ray,
        request.flights or experiment.flights or FlightOptions(), journal,
    )  # fmt: skip
    further = experiment.beside if request.place is None else ()
    study = replace(study, beside=tuple(_elsewhere(study, name, about) for name in further))
    results = yield from map_steps(experiment.run(study), _progress)
    figures: dict[str, bytes] = {}
    if out is not None:
        figures, left_out = _drawn(results)
        results = replace(results, summary=_with_left_out(results.summary, left_out))
    files = () if out is None else save_results(out, request.name, results, figures)
    if journal is not None:
        journal.path.unlink(missing_ok=True)
    return JobResult(results.summary, files)


def _progress(step: TrialDone) -> Progress:
    return Progress(f"{step.label}, {step.done} of {step.total}", step.done / max(1, step.total))


def _drawn(results: Results) -> tuple[dict[str, bytes], Row]:
    """The figures as PNG by name; where they cannot be drawn, none, and why."""
    try:
        return {title: png_of(draw()) for title, draw in results.figures.items()}, {}
    except MissingExtraError as error:
        return {}, {"figures": str(error)}


def _with_left_out(summary: Row, left_out: Row) -> Row:
    """A summary that says under `left_out` what was not done, and why."""
    return {**summary, "left_out": {**summary.get("left_out", {}), **left_out}} if left_out else summary


def _elsewhere(study: Study, place: str, about: str) -> Study:
    """The same study in another scene."""
    journal = None if study.journal is None else replace(study.journal, about=f"{about} {place}")
    return replace(study, open_arena=partial(open_arena, place), tasks=tasks_of(place), journal=journal)
