"""Arguments of a route, for the subcommands that plan: the place, start and goal, the planner."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Literal

from tyro.conf import Positional

from nerfnav.core.errors import InvalidInputError, require_not_negative
from nerfnav.field import UnknownSpace
from nerfnav.planner import PlannerConfig, PlannerEntry, planners
from nerfnav.planner.solvers.duration import is_hurried
from nerfnav_app.cli.number_arguments import numbers, words_argument
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.place import Place, open_place

PLANNER = "fast"
"""Which planner is used where none is named."""


def _end_numbers(words: list[str]) -> tuple[float, ...]:
    read = numbers(words, "an end")
    if len(read) not in (3, 4):
        raise ValueError(f"an end is X Y Z or X Y Z YAW, not {len(read)} numbers")
    return read


EndNumbers = Annotated[tuple[float, ...] | None, words_argument("X Y Z [YAW]", _end_numbers)]
"""Where a flight starts or ends, as words of a command line [m, rad]."""


@dataclass(frozen=True)
class Route:
    """Where to fly: in which place, from where to where."""

    place: Positional[str]
    """Name of a bundled scene, or path of a field file."""
    task: int | None = None
    """Number of one of the scene's tasks, as `nerfnav scenes` lists them; 0 where nothing else is said."""
    start: EndNumbers = None
    """Where to start: x y z [m] and perhaps the heading [rad]."""
    goal: EndNumbers = None
    """Where to arrive: x y z [m] and perhaps the heading [rad]."""
    robot: str | None = None
    """What moves: a name, or a file that describes it (see README); by default what the task is for."""
    planner: str = PLANNER
    """Which planner."""
    steps: int | None = None
    """Number of time steps; by default 20 for the tasks of a scene that so many can be enough for, elsewhere as many as
    the way takes."""
    dt: float | None = None
    """Length of a step [s]; by default 0.1, and longer where a large robot's way would have more than 80 of them."""
    unknown: Literal["occupied", "free"] = "occupied"
    """What planners take space for that no camera ever saw into, such as the insides of walls."""
    risk: float | None = None
    """What a collision that noise brings about costs [J]: the planner keeps wider of what is solid; 0 plans as if
    nothing disturbed the robot. By default 0 for plans, and 100 in flights of the fast planner."""
    json: bool = False
    """Print one JSON object and nothing else."""

    def open(self) -> Place:
        """The place, with the robot that was asked for or that the task is for."""
        if self.robot is not None:
            return open_place(self.place, self.robot)
        place = open_place(self.place)
        tasks = place.tasks
        number = 0 if self.task is None else self.task
        if self.start is not None or not 0 <= number < len(tasks):
            return place
        return place.with_robot(tasks[number].robot)

    def request(self, place: Place, config: PlannerConfig) -> PlanRequest:
        """What is asked of the planner."""
        steps = PlanRequest.steps if self.steps is None else self.steps
        dt = PlanRequest.dt if self.dt is None else self.dt
        ends = self._ends(place)
        distance = math.dist(ends.start.position, ends.goal.position)
        unknown = self.task_name(place) is None or is_hurried(place.robot, distance, steps * dt)
        return PlanRequest(
            ends,
            steps=steps,
            dt=dt,
            keep_dt=self.dt is not None,
            shortest=self.steps is None and unknown,
            planner=self.planner,
            unknown=UnknownSpace(self.unknown),
            config=self.weighing_risk(config),
        )

    def weighing_risk(self, config: PlannerConfig) -> PlannerConfig:
        """The planner's settings with the risk that was asked for."""
        if self.risk is None:
            return config
        require_not_negative(risk=self.risk)
        return replace(config, weights=replace(config.weights, risk=self.risk))

    def replanning(self, config: PlannerConfig, again: PlannerConfig) -> PlannerConfig | None:
        """Settings of the plans that are made in flight: `again`, or None where nothing was said of them.

        With the risk that was asked for they weigh that; else they follow the settings of the first plan.
        """
        entry = planners.load(self.planner)
        if again != entry.again(entry.config()):
            return again
        return None if self.risk is None else entry.in_flight(config, self.risk)

    def task_name(self, place: Place) -> str | None:
        """Name of the scene's task that is asked for; None where the ends are given."""
        tasks = place.tasks
        number = 0 if self.task is None else self.task
        return tasks[number].name if self.start is None and 0 <= number < len(tasks) else None

    def _ends(self, place: Place) -> Ends:
        """Start and goal. Raises InvalidInputError where they cannot be told from what was said."""
        tasks = place.tasks
        if self.start is not None and self.goal is not None and self.task is None:
            return Ends(_end_of(self.start), _end_of(self.goal))
        if self.start is not None or self.goal is not None:
            raise InvalidInputError("give either --task, or both --start and --goal")
        if not tasks:
            raise InvalidInputError(f"{place.name} has no tasks: give --start and --goal")
        number = 0 if self.task is None else self.task
        if not 0 <= number < len(tasks):
            raise InvalidInputError(f"{place.name} has tasks 0 to {len(tasks) - 1}, not {number}")
        return Ends.of_task(tasks[number])


def _end_of(read: tuple[float, ...]) -> End:
    return End((read[0], read[1], read[2]), read[3] if len(read) == 4 else 0.0)


def planner_of(words: Sequence[str]) -> PlannerEntry:
    """The planner that the words of a command line ask for. Raises UnknownNameError, which lists the known ones."""
    planner = PLANNER
    for word, following in pairwise([*words, ""]):
        if word == "--planner" or word.startswith("--planner="):
            planner = word.partition("=")[2] or following
    return planners.load(planner)
