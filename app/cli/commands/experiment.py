"""nerfnav experiment: reproduce the experiments of the paper, and run those of nerfnav."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from nerfnav.experiments import EndsChoice, FlightOptions
from nerfnav.navigation import WorldName
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output, note
from nerfnav_app.jobs.measure.experiment import EXPERIMENTS, ExperimentRequest
from nerfnav_app.jobs.measure.experiment import run as run_job


@dataclass(frozen=True)
class Arguments(Output):
    """Run an experiment: many trials, judged on the ground truth, with a table and figures."""

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
    ends: EndsChoice | None = None
    """Flights: start and goal of the tasks in turn, random ones, or both in turn (default: both)."""
    world: WorldName | None = None
    """Flights: the paper's noise, or motors, drag, wind and late pictures (default: paper)."""
    risk: float | None = None
    """Flights: cost of a collision by noise [J], as in `fly`; 0 plans without noise."""
    truth: bool = False
    """Flights: fly each a second time with the true state, to show what noise alone costs."""
    robot: Annotated[str | None, arg(metavar="NAME|FILE")] = None
    """Flights: the robot, as in `fly` (default: that of the tasks)."""


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
    """Options of whole flights; None where none was given."""
    given = arguments.ends, arguments.world, arguments.risk, arguments.robot
    if all(option is None for option in given) and not arguments.truth:
        return None
    own, (ends, world, risk, robot) = FlightOptions(), given
    return FlightOptions(ends or own.ends, world or own.world, risk, arguments.truth, robot)
