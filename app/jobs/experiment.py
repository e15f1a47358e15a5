"""Experiment: many trials, a table, figures, and the numbers that sum them up."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from app.jobs.events import JobEvents, JobResult, Progress
from app.jobs.experiment_catalog import EXPERIMENTS, Experiment
from app.places.opening import open_place
from app.storage.output_files import json_line, prepare_folder, write_bytes, write_text
from nerfnav.errors import InvalidInputError, MissingExtraError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.study import Results, Row, Study, TrialDone
from nerfnav.field.voxel import VoxelField
from nerfnav.world.task import Task

if TYPE_CHECKING:
    import matplotlib.figure


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
    """Folder for results.json, the table and the figures; None writes nothing."""


def run(request: ExperimentRequest) -> JobEvents:
    """Yield how far it is; return the summary and what was written. Raises NerfnavError for bad requests."""
    experiment = EXPERIMENTS[request.name]
    out = None if request.out is None else prepare_folder(request.out)
    yield Progress("opening the field", 0.0)
    place = request.place or experiment.place
    open_here = partial(open_arena, place)
    tasks = _tasks(experiment, place, open_here())
    study = Study(open_here, tasks, request.trials, request.seed, request.jobs, request.ray)
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
    files = () if out is None else save(out, request.name, results, figures)
    return JobResult(results.summary, files)


@cache
def open_arena(place: str) -> Arena:
    """A scene with its trained field, opened once in each process. Raises InvalidInputError without a ground truth."""
    opened = open_place(place)
    if opened.scene is None:
        raise InvalidInputError(f"experiments are judged on a ground truth, and {place} has none: name a scene")
    if not isinstance(opened.field, VoxelField):
        raise InvalidInputError(f"experiments fly in voxel fields: run `nerfnav bake {place}` first")
    return Arena(opened.scene, opened.field)


def _drawn(results: Results) -> tuple[dict[str, bytes], Row]:
    """The figures as PNG by name; where they cannot be drawn, none, and why."""
    try:
        return {title: png_of(draw()) for title, draw in results.figures.items()}, {}
    except MissingExtraError as error:
        return {}, {"figures": str(error)}


def _with_left_out(summary: Row, left_out: Row) -> Row:
    """A summary that says under `left_out` what was not done, and why."""
    return {**summary, "left_out": {**summary.get("left_out", {}), **left_out}} if left_out else summary


def save(folder: Path, name: str, results: Results, figures: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Write results.json, the table as NAME.csv, and each figure, given as PNG."""
    content = {"experiment": name, "summary": results.summary, "rows": list(results.rows)}
    files = [write_text(folder / "results.json", json_line(content) + "\n")]
    if results.rows:
        files.append(write_text(folder / f"{name}.csv", table_text(results.rows)))
    return (*files, *(write_bytes(folder / f"{title}.png", png) for title, png in figures.items()))


def table_text(rows: Sequence[Row]) -> str:
    """CSV of lines that all have the same names."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(
        {name: f"{cell:.9g}" if isinstance(cell, float) else cell for name, cell in row.items()} for row in rows
    )
    return stream.getvalue()


def png_of(figure: "matplotlib.figure.Figure") -> bytes:
    """A drawing as PNG."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    return stream.getvalue()


def _tasks(experiment: Experiment, place: str, arena: Arena) -> tuple[Task, ...]:
    """The experiment's own flights where it happens in its own place, else those of the scene."""
    own = experiment.tasks if place == experiment.place else None
    return arena.scene.tasks if own is None else own
