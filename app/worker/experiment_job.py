"""Experiments as a job of the worker: in a process of their own."""

from functools import partial
from pathlib import Path

from nerfnav_app.jobs.events import JobEvents
from nerfnav_app.jobs.subprocess_job import in_subprocess
from nerfnav_app.state.session import Session
from nerfnav_app.storage.experiment_store import ExperimentStore
from nerfnav_app.storage.run_store import RunStore


def begin_experiment(session: Session, runs: RunStore) -> JobEvents:
    """The experiment that the session asks for; its results are kept beside the runs."""
    asked = session.experiments.asked
    assert asked is not None, "an experiment is begun by who says which"
    out = ExperimentStore(runs.folder).new(asked.name)
    return in_subprocess(partial(_do_experiment, asked.name, asked.trials, out))


def _do_experiment(name: str, trials: int | None, out: Path) -> JobEvents:
    # imported where it is done: with their figures, experiments take long to import
    from nerfnav_app.jobs import experiment

    return experiment.run(experiment.ExperimentRequest(name, trials=trials, out=out))
