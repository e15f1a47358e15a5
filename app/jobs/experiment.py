"""Experiment: many trials, a table, figures, and the numbers that sum them up."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from nerfnav import __version__
from nerfnav.errors import InvalidInputError, MissingExtraError
from nerfnav.experiments import FlightOptions, Journal, Results, Row, Study, TrialDone
from nerfnav_app.jobs.arena import open_arena
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.experiment_catalog import EXPERIMENTS
from nerfnav_app.jobs.result_files import png_of, save_results
from nerfnav_app.storage.output_files import prepare_folder
from nerfnav_scenes import tasks_of


@dataclass(frozen=True)
class ExperimentRequest:
    """What to find out."""

    name: str
    """Of the experiment."""
    place: str | None = None
    """Scene or field to do it in; None: the experiment's own."""
    trials: int | None = None
    """How many trials; None: as many as the experiment needs."""
    seed: int = 0
    """Of everything random."""
    jobs: int | None = None
    """Trials at the same time."""
    ray: str | None = None
    """Address of a Ray cluster that does the trials; None: this machine."""
    out: Path | None = None
    """Folder for results.json, the table and the figures, and for trials.jsonl, which lets an experiment that was
    interrupted go on where it was; None writes nothing."""
    flights: FlightOptions | None = None
    """Options of the experiment on whole flights; None: its own, and for all others."""


def run(request: ExperimentRequest) -> JobEvents:
    """Yield how far it is; return the summary and what was written. Raises NerfnavError for bad requests."""
    experiment = EXPERIMENTS[request.name]
    if request.flights is not None and not experiment.flies:
        flying = ", ".join(name for name, other in EXPERIMENTS.items() if other.flies)
        raise InvalidInputError(f"the experiment {request.name} takes no options of whole flights, only {flying} does")
    out = None if request.out is None else prepare_folder(request.out)
    yield Progress("opening the field", 0.0)
    place = request.place or experiment.place
    open_here = partial(open_arena, place)
    tasks = experiment.tasks_in(place, open_here())
    about = f"{request.name}, seed {request.seed}, {request.flights}, {__version__}, in"
    journal = None if out is None else Journal(out / "trials.jsonl", f"{about} {place}")
    study = Study(
        open_here, tasks, request.trials, request.seed, request.jobs, request.ray,
        request.flights or FlightOptions(), journal,
    )  # fmt: skip
    further = experiment.beside if request.place is None else ()
    study = replace(study, beside=tuple(_elsewhere(study, name, about) for name in further))
    results: Results | None = None
    for step in experiment.run(study):
        if isinstance(step, TrialDone):
            yield Progress(f"{step.label}, {step.done} of {step.total}", step.done / max(1, step.total))
        else:
            results = step
    assert results is not None, "an experiment ends with its results"
    figures: dict[str, bytes] = {}
    if out is not None:
        figures, left_out = _drawn(results)
        results = replace(results, summary=_with_left_out(results.summary, left_out))
    files = () if out is None else save_results(out, request.name, results, figures)
    if journal is not None:
        journal.path.unlink(missing_ok=True)
    return JobResult(results.summary, files)


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
