"""Registry of experiments: name, function, place, flights and costs of each.

A new experiment is a file in nerfnav/experiments and an entry in EXPERIMENTS.
"""

from collections.abc import Callable
from dataclasses import dataclass

from nerfnav.core.registry import Registry
from nerfnav.experiments import (
    Arena,
    ExperimentSteps,
    FlightOptions,
    Study,
    basin,
    closed_loop,
    correlation,
    estimation,
    ground_robots,
    planners,
    reflight,
    relocalisation,
    replanning,
    tangent,
)
from nerfnav.experiments.moving import crossing
from nerfnav.experiments.moving import experiment as moving
from nerfnav.experiments.rivals import experiment as rivals
from nerfnav.world import Task
from nerfnav_app.benchmarks import timing
from nerfnav_scenes.tasks import stonehenge


@dataclass(frozen=True)
class Experiment:
    """Entry of the registry of experiments."""

    name: str
    """Name on the command line."""
    run: Callable[[Study], ExperimentSteps]
    """Function that runs it."""
    purpose: str
    """Purpose, for the user."""
    place: str = "stonehenge"
    """Default place: name of a scene, or path of a field."""
    tasks: tuple[Task, ...] | None = None
    """Flights in that place; None: those of its scene."""
    beside: tuple[str, ...] = ()
    """Further scenes that it happens in where no place is asked for."""
    flights: FlightOptions | None = None
    """Options of whole flights where none are given; None: it takes none."""
    quick: int = 2
    """Trials of `--quick`."""
    cost: float = 10.0
    """CPU time of these trials [s], about: its share of the progress of all experiments."""
    alone: bool = False
    """It measures times, so nothing runs beside it: neither --jobs nor --ray."""
    own_worlds: bool = False
    """It flies in worlds of its own, so it takes no place."""
    headline: tuple[str, ...] = ()
    """Numbers of its summary that the figure of a sweep shows; none: the first three."""

    def tasks_in(self, place: str, arena: Arena) -> tuple[Task, ...]:
        """Its own flights where it happens in its own place, else those of the scene."""
        own = self.tasks if place == self.place else None
        return arena.scene.tasks if own is None else own


EXPERIMENTS: Registry[Experiment] = Registry("experiment", (
    Experiment(
        "planners",
        planners.run,
        "nerfnav, minimum snap and RRT on the same flights: collision cost, effort, failures",
        tasks=stonehenge.EXPERIMENT_TASKS,
        quick=10,
        cost=5,
        headline=("nerfnav.failures", "nerfnav.collision_mean", "nerfnav.effort_mean"),
    ),
    Experiment(
        "flights",
        closed_loop.run,
        "whole flights by camera, of the tasks and between random ends: how many arrive, errors, honesty, times",
        flights=FlightOptions(),
        quick=10,
        cost=20,
        headline=("reached", "collided", "position_median_m", "step_p50_ms"),
    ),
    Experiment(
        "replanning",
        replanning.run,
        "the same first plans in closed loop by camera and in open loop, under the same noise: how many arrive",
        place="playground",
        beside=("stonehenge", "church", "apartment"),
        flights=FlightOptions("tasks", fly_on=True),
        quick=5,
        cost=45,
        headline=("together.closed.reached", "together.open.reached", "together.closed.cost_ratio_median"),
    ),
    Experiment(
        "timing",
        timing.run,
        "plan, replan, filter and covariance: times printed in the paper, its way on this machine, and nerfnav",
        quick=1,
        cost=20,
        alone=True,
    ),
    Experiment(
        "rivals",
        rivals.run,
        "other people's planners beside nerfnav's on the same pairs of ends: clean flights, times, cost",
        beside=("playground", "church"),
        quick=4,
        cost=10,
        headline=("methods.nerfnav.clean", "methods.nerfnav.J_median", "methods.nerfnav.time_p50_ms"),
    ),
    Experiment(
        "collision-correlation",
        correlation.run,
        "collision loss in the field against true overlap, over the iterations of plans",
        place="playground",
        quick=5,
        cost=2,
        headline=("spearman_median", "final_overlaps"),
    ),
    Experiment(
        "ground-robots",
        ground_robots.run,
        "a couch that must turn to pass a gap, and wheels that never slide: overlap, lateral velocity",
        place="church",
        quick=10,
        cost=12,
        headline=("couch_touched", "couch_held_touched", "wheel_lateral_speed_max_mps"),
    ),
    Experiment(
        "estimation",
        estimation.run,
        "the pose filter against iNeRF on the same disturbed flights: errors, honesty",
        tasks=stonehenge.EXPERIMENT_TASKS[:10],
        quick=5,
        cost=8,
        headline=("methods.nerfnav.position_rmse_m", "methods.inerf.position_rmse_m", "nees_mean"),
    ),
    Experiment(
        "relocalisation",
        relocalisation.run,
        "finding a camera anywhere in the place from one picture: how often, how sure, how fast",
        quick=10,
        cost=25,
    ),
    Experiment(
        "basin",
        basin.run,
        "from how far off one picture leads the pose filter back",
        tasks=stonehenge.EXPERIMENT_TASKS[:10],
        quick=5,
        cost=3,
    ),
    Experiment(
        "tangent-plane",
        tangent.run,
        "Adam in the tangent of the last state against a single tangent plane: convergence (paper Eq. 8)",
        quick=3,
        cost=18,
    ),
    Experiment(
        "reflight",
        reflight.run,
        "exports flown again by RotorPy and Mellinger's controller: clean on the mesh, tracking errors",
        beside=("playground", "church"),
        quick=2,
        cost=15,
    ),
    Experiment(
        "moving", moving.run,
        "corridors full of moving boxes (SANDO's worlds): announced motion against planners that see only the present",
        quick=1, cost=60, alone=True, own_worlds=True,
        headline=tuple(f"methods.announced.{level}.successes" for level in ("easy", "medium", "hard")),
    ),
    Experiment(
        "crossing", crossing.run,
        "a box crosses the planned way of flights by camera, announced to the planner or not: hits, arrivals, errors",
        beside=("apartment",), quick=1, cost=60,
        headline=tuple(f"together.announced.pace_{pace:g}.clean" for pace in crossing.PACES),
    ),
))  # fmt: skip
"""Name to experiment."""


def register(experiment: Experiment) -> None:
    """Make an experiment known by its name. Raises NameTakenError where another one has it."""
    EXPERIMENTS.register(experiment)
