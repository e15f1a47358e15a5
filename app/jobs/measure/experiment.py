"""What `nerfnav experiment NAME` knows. A new experiment is a file in nerfnav/experiments and an entry here."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from nerfnav.core.registry import Registry
from nerfnav.experiments import (
    Arena,
    ExperimentStep,
    Study,
    basin,
    closed_loop,
    correlation,
    estimation,
    ground_robots,
    planners,
    reflight,
    relocalisation,
    tangent,
)
from nerfnav.world import Task
from nerfnav_scenes.tasks import stonehenge


@dataclass(frozen=True)
class Experiment:
    """One experiment."""

    name: str
    """What users call it."""
    run: Callable[[Study], Iterator[ExperimentStep]]
    """What does it."""
    purpose: str
    """What it shows, for people."""
    place: str = "stonehenge"
    """Where it happens unless another place is asked for: name of a scene, or path of a field."""
    tasks: tuple[Task, ...] | None = None
    """Flights in that place; None: those of its scene."""
    beside: tuple[str, ...] = ()
    """Further scenes that it happens in where no place is asked for."""
    flies: bool = False
    """Whether it takes the options of whole flights (Study.flights)."""

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
    ),
    Experiment(
        "flights",
        closed_loop.run,
        "whole flights by camera, of the tasks and between random ends: how many arrive, errors, honesty, times",
        flies=True,
    ),
    Experiment(
        "collision-correlation",
        correlation.run,
        "collision loss in the field against true overlap, over the iterations of plans",
        place="playground",
    ),
    Experiment(
        "ground-robots",
        ground_robots.run,
        "a couch that must turn to pass a gap, and wheels that never slide: overlap, lateral velocity",
        place="church",
    ),
    Experiment(
        "estimation",
        estimation.run,
        "the pose filter against iNeRF on the same disturbed flights: errors, honesty",
        tasks=stonehenge.EXPERIMENT_TASKS[:10],
    ),
    Experiment(
        "relocalisation",
        relocalisation.run,
        "finding a camera anywhere in the place from one picture: how often, how sure, how fast",
    ),
    Experiment(
        "basin",
        basin.run,
        "from how far off one picture leads the pose filter back",
        tasks=stonehenge.EXPERIMENT_TASKS[:10],
    ),
    Experiment(
        "tangent-plane",
        tangent.run,
        "Adam in the tangent of the last state against a single tangent plane: convergence (paper Eq. 8)",
    ),
    Experiment(
        "reflight",
        reflight.run,
        "exports flown again by RotorPy and Mellinger's controller: clean on the mesh, tracking errors",
        beside=("playground", "church"),
    ),
))  # fmt: skip
"""Name to experiment."""


def register(experiment: Experiment) -> None:
    """Make an experiment known by its name. Raises NameTakenError where another one has it."""
    EXPERIMENTS.register(experiment)
