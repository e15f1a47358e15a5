"""Where does Adam step: in the tangent of the last state, or always in that of the prediction? (paper Eq. 8)

    recursive   x_k+1 = x_k (+) d_k            every step in the tangent of the state before it
    single      x_k+1 = x_0 (+) (d_0 + ... + d_k)   all in the tangent plane of the prediction

Both start from the same wrong poses and minimise the same cost. Its picture is what the field itself shows from the
true pose, so that nothing but the planes is to blame for what is left, and reduced to an eighth: the large errors would
be hopeless at full size, with either. For small errors the two planes are alike; the further the attitude has to turn,
the more the single plane is bent against it: by half the angle in the direction of a step.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

from nerfnav.estimator import DescentConfig
from nerfnav.estimator.paper.adam import descend
from nerfnav.estimator.paper.retraction import retract
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.study import ExperimentStep, Results, Row, Study, run_trials
from nerfnav.experiments.tangent_guess import first_guess
from nerfnav.experiments.tangent_results import ERRORS, METHODS, picture, summary_of
from nerfnav.robots import ATTITUDE, POSITION

_TRIALS, _ITERATIONS = 24, 120
_RATE = 0.05
"""Adam's first step of an attitude number [rad], so that both can reach the truth."""


@dataclass(frozen=True)
class Start:
    """One trial."""

    seed: int
    """Of the place and the error."""
    error: float
    """Angle by which the first attitude is off [rad]."""
    iterations: int = _ITERATIONS
    """Adam's steps."""


def run(study: Study) -> Iterator[ExperimentStep]:
    """Go down from every start both ways; the table has a line for each start, method and iteration."""
    seeds = range(study.seed, study.seed + (study.trials or _TRIALS))
    starts = [Start(seed, error) for error in ERRORS for seed in seeds]
    tables = yield from run_trials(study, "going down", compare, starts)
    rows = tuple(row for table in tables for row in table)
    yield Results(summary_of(rows), rows, {"tangent": partial(picture, rows)})


def compare(arena: Arena, start: Start) -> list[Row]:
    """Cost and pose error of both over the iterations."""
    truth, first, cost = first_guess(arena, start.seed, start.error)
    rows = []
    for method, recursive in METHODS.items():
        config = DescentConfig(start.iterations, attitude_rate=_RATE, recursive=recursive)
        for iteration, (state, terms) in enumerate(descend(cost, first, config, retract)):
            off = truth.local(state)
            rows.append({
                "seed": start.seed, "start_rad": start.error, "method": method, "iteration": iteration,
                "cost": terms.total.item(), "position_m": off[POSITION].norm().item(),
                "rotation_rad": off[ATTITUDE].norm().item(),
            })  # fmt: skip
    return rows
