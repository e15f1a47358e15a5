"""nerfnav experiment: reproduce the experiments of the paper, and run those of nerfnav."""

from dataclasses import dataclass, fields, replace
from typing import Annotated

from tyro.conf import arg

from nerfnav.core.errors import UnknownNameError
from nerfnav.experiments import EndsChoice, FlightOptions
from nerfnav.navigation import WorldName
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output, note
from nerfnav_app.jobs.measure.catalog import EXPERIMENTS
from nerfnav_app.jobs.measure.experiment import ExperimentOptions, ExperimentRequest
from nerfnav_app.jobs.measure.experiment import run as run_job
from nerfnav_app.jobs.measure.series import ALL
from nerfnav_app.jobs.measure.series import run as run_all


@dataclass(frozen=True)
class Arguments(ExperimentOptions, Output):
    """Run an experiment: many trials, judged on the ground truth, with a table and figures."""

    ends: EndsChoice | None = None
    """Flights, replanning: ends of the tasks in turn, random ones, or both in turn (default: both; replanning:
    tasks)."""
    world: WorldName | None = None
    """Flights, replanning: the paper's noise, or motors, drag, wind and late pictures (default: paper)."""
    risk_weight: float | None = None
    """Flights, replanning: cost of a collision by noise [J], as in `fly`; 0 plans without noise."""
    truth: bool = False
    """Flights: fly each a second time with the true state, to show what noise alone costs."""
    robot: Annotated[str | None, arg(metavar="NAME|FILE")] = None
    """Flights, replanning: the robot, as in `fly` (default: that of the tasks)."""
    fly_on: bool = False
    """Flights: count a contact and fly on, as in `fly` (default: a contact ends the flight). Replanning always does."""
    imu: bool = False
    """Flights, replanning: with an inertial unit, as in `fly`; in open loop nothing uses it."""


def run(arguments: Arguments) -> None:
    """Run it, and print its numbers. Raises UnknownNameError."""
    if arguments.name not in (names := (*EXPERIMENTS, ALL)):
        raise UnknownNameError(EXPERIMENTS.kind, arguments.name, names)
    request = ExperimentRequest(
        arguments.name,
        place=arguments.place,
        obstacles=arguments.obstacles,
        trials=arguments.trials,
        seed=arguments.seed,
        jobs=arguments.jobs,
        ray=arguments.ray,
        out=arguments.out,
        quick=arguments.quick,
        sweep=arguments.sweep,
        flights=_options(arguments),
    )
    job = run_all(request) if arguments.name == ALL else run_job(request)
    finished = run_and_print(f"experiment {arguments.name}", job, arguments.json)
    for path in finished.files:
        note(f"wrote {path}")


def _options(arguments: Arguments) -> FlightOptions | None:
    """Options of whole flights, those that were not given as the experiment has them; None where none was given."""
    found = {option.name: getattr(arguments, option.name) for option in fields(FlightOptions)}
    given = {name: value for name, value in found.items() if value is not None and value is not False}
    own = None if arguments.name == ALL else EXPERIMENTS[arguments.name].flights
    return replace(own or FlightOptions(), **given) if given else None
