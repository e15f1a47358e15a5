"""nerfnav experiment: what the paper shows, shown again."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from nerfnav.experiments import EndsChoice, FlightOptions
from nerfnav.navigation import WorldName
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import note
from nerfnav_app.jobs.measure.experiment import EXPERIMENTS, ExperimentRequest
from nerfnav_app.jobs.measure.experiment import run as run_job


@dataclass(frozen=True)
class Arguments:
    """Run an experiment: many trials, judged on the ground truth, summed up in a table and figures."""

    name: Annotated[Positional[str], arg(help=f"Which experiment: {', '.join(EXPERIMENTS)}.")]
    trials: int | None = None
    """How many trials; by default as many as the experiment needs."""
    jobs: int | None = None
    """Trials at the same time; 1 by default."""
    ray: str | None = None
    """Address of a Ray cluster that does the trials (auto, local, ray://HOST:PORT)."""
    seed: int = 0
    """Seed of everything random."""
    place: str | None = None
    """Scene or field file to do it in; by default the experiment's own scene."""
    out: Path | None = None
    """Folder for results.json, the table as CSV and the figures as PNG; the same command goes on where an experiment
    in it was interrupted."""
    ends: EndsChoice | None = None
    """Of flights: between the ends of the place's tasks in turn, random ones, or both by turns (the default)."""
    world: WorldName | None = None
    """Of flights: the paper's noise (the default), or a physical world with motors, drag, wind and late pictures."""
    risk: float | None = None
    """Of flights: what a collision that noise brings about costs [J], as for `fly`; 0: plan as if nothing pushed."""
    truth: bool = False
    """Of flights: fly each a second time with the state known, which says what noise alone costs."""
    robot: str | None = None
    """Of flights: what moves, a name or a file as for `fly`; by default what the tasks are for."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Run it, and print its numbers."""
    request = ExperimentRequest(
        arguments.name,
        place=arguments.place,
        trials=arguments.trials,
        seed=arguments.seed,
        jobs=arguments.jobs,
        ray=arguments.ray,
        out=arguments.out,
        flights=_options(arguments),
    )
    finished = run_and_print(f"experiment {arguments.name}", run_job(request), arguments.json)
    for path in finished.files:
        note(f"wrote {path}")


def _options(arguments: Arguments) -> FlightOptions | None:
    """The options of whole flights; None where none was given."""
    given = arguments.ends, arguments.world, arguments.risk, arguments.robot
    if all(option is None for option in given) and not arguments.truth:
        return None
    own, (ends, world, risk, robot) = FlightOptions(), given
    return FlightOptions(ends or own.ends, world or own.world, risk, arguments.truth, robot)
