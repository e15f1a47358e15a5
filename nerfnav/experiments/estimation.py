"""The paper's comparison of pose filters: who follows a robot that only sees?

Disturbed flights (see experiments/disturbed.py) are photographed from the mesh; all estimators get the same first
belief, the same actions and the same pictures.
"""

from collections.abc import Iterator
from functools import lru_cache, partial

import torch

from nerfnav.estimator import Belief, Estimator, FilterOutcome, inerf
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.disturbed import DT, STEPS, disturbed_flight
from nerfnav.experiments.disturbed_flights import Trial, over_flights
from nerfnav.experiments.estimation_errors import errors_of
from nerfnav.experiments.estimation_results import METHODS, picture, summary_of
from nerfnav.experiments.fast_filter import fast_filter
from nerfnav.experiments.held_out_views import renderer_of, take_picture
from nerfnav.experiments.study import ExperimentStep, Results, Row, Study
from nerfnav.robots import StateNoise

_FIRST = StateNoise.isotropic(0.01**2)  # spread of the first belief: 1 cm, 0.01 rad


def run(study: Study) -> Iterator[ExperimentStep]:
    """Fly and estimate; the table has a line for each trial, method and time step."""
    rows = yield from over_flights(study, "estimating", follow)
    yield Results(summary_of(rows), tuple(rows), {"estimation": partial(picture, rows)})


def follow(arena: Arena, trial: Trial) -> list[Row]:
    """Fly once, and let every method estimate."""
    actions, truths = disturbed_flight(arena, trial)
    renderer = renderer_of(arena)
    images = [take_picture(renderer, truths[index].pose) for index in range(1, STEPS + 1)]
    start = truths[0].retract(_FIRST.sample(torch.Generator().manual_seed(trial.seed)))
    rows = []
    for method in METHODS:
        generator = torch.Generator().manual_seed(trial.seed)
        belief = Belief(start, _FIRST.covariance())
        for index, (action, image) in enumerate(zip(actions, images, strict=True)):
            *_, last = _estimators(arena)[method].update(belief, image, action, DT, generator)
            assert last.posterior is not None, "the last step of an estimator has the posterior"
            belief = last.posterior
            judged = errors_of(belief, truths[index + 1])
            rows.append({"seed": trial.seed, "task": trial.task.name, "method": method, "step": index + 1} | judged
                        | {"outcome": (last.outcome or FilterOutcome.UPDATED).name.lower()})  # fmt: skip
    return rows


@lru_cache(maxsize=2)
def _estimators(arena: Arena) -> dict[str, Estimator]:
    """All methods, made once in each process."""
    own = fast_filter(arena)
    return {"nerfnav": own, "inerf": inerf(own.field, own.robot, own.camera, config=own.config)}
