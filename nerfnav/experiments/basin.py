"""From how far off does one picture lead back? The pose filter's basin of convergence.

Robots on disturbed flights are believed to be elsewhere: off by so many centimetres in a random direction, and turned
by so many radians about a random axis. The prior knows how large such errors are (a standard deviation of the error's
length over the root of 3 along each axis), and the fast filter corrects it by one picture from the mesh. Pictures of
nothing but sky, from which nothing can converge, count like all others.
"""

from collections.abc import Iterator
from functools import partial

import torch

from nerfnav.experiments.arena import Arena
from nerfnav.experiments.basin_results import SIZES, picture, summary_of
from nerfnav.experiments.basin_trial import corrected
from nerfnav.experiments.disturbed import disturbed_flight
from nerfnav.experiments.disturbed_flights import Trial, over_flights
from nerfnav.experiments.held_out_views import renderer_of, take_picture
from nerfnav.experiments.study import ExperimentStep, Results, Row, Study


def run(study: Study) -> Iterator[ExperimentStep]:
    """Correct a belief of every size on every flight."""
    rows = yield from over_flights(study, "correcting", correct)
    yield Results(summary_of(rows), tuple(rows), {"basin": partial(picture, rows)})


def correct(arena: Arena, trial: Trial) -> list[Row]:
    """One place of a flight, its picture, and a correction of each size."""
    generator = torch.Generator().manual_seed(trial.seed)
    _, states = disturbed_flight(arena, trial)
    truth = states[int(torch.randint(1, len(states.position), (1,), generator=generator))]
    image = take_picture(renderer_of(arena), truth.pose)
    where = {"seed": trial.seed, "task": trial.task.name}
    return [where | corrected(arena, (truth, image), size, generator) for size in SIZES]
