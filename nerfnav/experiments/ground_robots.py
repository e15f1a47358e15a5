"""Robots on the ground: a couch that must turn to pass a gap, and wheels that never slide.

Couch: each of its tasks is planned as it is, and those that begin and end with one heading again with this heading
held, by a term that is added to J. Only what can turn fits through a gap that is narrower than it is long.

Differential drive: each of its tasks is driven there, and back in reverse. A robot on wheels has no velocity across
its heading, at any time.

Planned on the field, judged on the mesh. Drives that the field does not allow to begin or end are counted as refused.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np

from nerfnav.experiments.drives import drives_of
from nerfnav.experiments.ground_results import COUCH, WHEELS, picture, summary_of
from nerfnav.experiments.ground_trial import drive
from nerfnav.experiments.outlines import outlines
from nerfnav.experiments.study import ExperimentStep, Results, Study, run_trials


def run(study: Study) -> Iterator[ExperimentStep]:
    """Plan all drives of couches and differential drives; those of other robots are left out."""
    tasks = [task for task in study.tasks if task.robot in (COUCH, WHEELS)]
    drives = [one for task in study.first(tasks, "ground tasks") for one in drives_of(task)]
    answers = yield from run_trials(study, "planning", drive, drives)
    done = [answer for answer in answers if answer is not None]
    rows, ways = tuple(row for row, _ in done), [way for _, way in done]
    walls = outlines(study.open_arena(), rows[0]["height_m"]) if rows else np.empty((0, 2, 2))
    summary = {**summary_of(rows), "refused": len(answers) - len(done)}
    yield Results(summary, rows, {"ground_robots": partial(picture, rows, ways, walls)})
