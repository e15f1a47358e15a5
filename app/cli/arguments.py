"""Arguments that several subcommands share: numbers in a row, the placement of a source, and routes.

A route is what `plan` and `fly` need: the place, start and goal, the planner.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, make_dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional, arg
from tyro.constructors import PrimitiveConstructorSpec

from nerfnav.core.errors import InvalidInputError, require_not_negative
from nerfnav.field import UnknownSpace
from nerfnav.importers import AXES, MeasuredDistance, Placement
from nerfnav.navigation import NavigateConfig, WorldName, explain_blindness
from nerfnav.planner import PlannerConfig, PlannerEntry, planners
from nerfnav.planner.solvers.duration import is_hurried
from nerfnav.world import Task
from nerfnav_app.cli.terminal import Output, note
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.place import Place, open_place

PLANNER = "fast"
"""Planner of a command line that names none."""


def parse_numbers(words: list[str], what: str) -> tuple[float, ...]:
    """Read numbers from words, with spaces or commas between them.

    Raises ValueError, which names `what` they are, for all but finite numbers.
    """
    try:
        read = tuple(float(part) for word in words for part in word.split(","))
    except ValueError:
        raise ValueError(f"{what} is made of numbers, not of {' '.join(words)!r}") from None
    if not all(math.isfinite(number) for number in read):
        raise ValueError(f"{what} is made of finite numbers, not of {' '.join(words)}")
    return read


def parse_count(what: str, count: int, words: list[str]) -> tuple[float, ...]:
    """Read `count` numbers. Raises ValueError, which names `what` they are, for more or less of them."""
    read = parse_numbers(words, what)
    if len(read) != count:
        raise ValueError(f"{what} takes {count} numbers, not {len(read)}")
    return read


def numbers_argument(what: str, metavar: str) -> PrimitiveConstructorSpec[Any]:
    """Make an optional argument called `what` of as many numbers as `metavar` has words."""
    return words_argument(metavar, partial(parse_count, what, len(metavar.split())))


def words_argument(metavar: str, read: Callable[[list[str]], tuple[float, ...]]) -> PrimitiveConstructorSpec[Any]:
    """Make an optional argument of words that help calls `metavar`; None where it is not given."""
    return PrimitiveConstructorSpec(
        nargs="*",
        metavar=metavar,
        instance_from_str=read,
        is_instance=lambda value: value is None or isinstance(value, tuple),
        str_from_instance=lambda value: [] if value is None else [f"{number:g}" for number in value],
    )


def vector(numbers: Sequence[float]) -> tuple[float, float, float]:
    """Check that there are three numbers, for the type checker."""
    x, y, z = numbers
    return x, y, z


def measured_distance(numbers: tuple[float, ...]) -> MeasuredDistance:
    """Convert seven numbers to two points and their distance."""
    return MeasuredDistance(vector(numbers[:3]), vector(numbers[3:6]), numbers[6])


def _parse_up(words: list[str]) -> tuple[float, ...]:
    """Read a direction: three numbers, or an axis by its name."""
    return AXES[words[0]] if len(words) == 1 and words[0] in AXES else parse_count("up", 3, words)


Up = Annotated[tuple[float, ...] | None, words_argument("X Y Z|AXIS", _parse_up)]
Corners = Annotated[tuple[float, ...] | None, numbers_argument("box", "X Y Z X Y Z")]
_Picked = Annotated[tuple[float, ...] | None, numbers_argument("picked", "X Y Z X Y Z DISTANCE")]


@dataclass(frozen=True)
class PlacementArguments:
    """Placement of a source in the world. What is not given is guessed, and the guess is printed."""

    up: Up = None
    """Up direction in the axes of the source: X Y Z, or the name of an axis (y, z)."""
    scale: float | None = None
    """Metres in one unit of the source."""
    picked: _Picked = None
    """Scale by measurement: two points in units of the source, and their true distance [m]."""
    box: Corners = None
    """Lowest and highest corner of the field, after scale and up [m]."""

    def placement(self) -> Placement:
        """Convert to the record that jobs take."""
        return Placement(
            None if self.up is None else vector(self.up),
            self.scale,
            None if self.picked is None else measured_distance(self.picked),
            None if self.box is None else (vector(self.box[:3]), vector(self.box[3:])),
        )


def _parse_end(words: list[str]) -> tuple[float, ...]:
    read = parse_numbers(words, "an end")
    if len(read) not in (3, 4):
        raise ValueError(f"an end is X Y Z or X Y Z YAW, not {len(read)} numbers")
    return read


_EndNumbers = Annotated[tuple[float, ...] | None, words_argument("X Y Z [YAW]", _parse_end)]


@dataclass(frozen=True)
class Route(Output):
    """Route of a plan or a flight: the place, start and goal, the planner."""

    place: Positional[str]
    """Name of a bundled scene, or path of a field file."""
    task: int | None = None
    """Number of a task of the scene, see `nerfnav scenes` (default: 0, unless --start and --goal are given)."""
    start: _EndNumbers = None
    """Start position [m], and optionally the heading [rad]."""
    goal: _EndNumbers = None
    """Goal position [m], and optionally the heading [rad]."""
    robot: Annotated[str | None, arg(metavar="NAME|FILE")] = None
    """Robot: a name, or a file that describes it (default: that of the task)."""
    planner: Annotated[str, arg(help=f"Planner: {', '.join(planners.names())}.")] = PLANNER
    steps: int | None = None
    """Number of time steps (default: 20 for tasks that 20 can be enough for, else as many as the path takes)."""
    dt: float | None = None
    """Length of a time step [s] (default: 0.1, longer for large robots whose path would take more than 80 steps)."""
    unknown: Literal["occupied", "free"] = "occupied"
    """How planners treat space that no camera saw into, such as the insides of walls."""
    duration: Annotated[float | Literal["auto"] | None, arg(metavar="FLOAT|auto")] = None
    """Duration [s], in place of --steps; auto: the shortest that keeps the robot's limits (default: 2 for tasks,
    else auto). Of long paths, auto finds it within a half."""
    max_collision: float | None = None
    """Largest probability of a collision: the plan is refined until it keeps it, or refused."""
    max_blind: Annotated[float | None, arg(metavar="SHARE")] = None
    """Largest share of the way with too little to see, 0 to 1: a plan with more is refused."""
    risk_weight: float | None = None
    """Cost of a collision by noise [J]: more keeps farther from obstacles, 0 keeps 4 cm of room instead (default: 100
    for the fast planner)."""
    paper_cost: bool = False
    """Minimise the paper's Eq. 2 alone: no noise model, no room for noise, no choice of headings."""
    obstacles: Path | None = None
    """Obstacles in the place, in YAML or JSON: boxes, spheres, cylinders, prisms and meshes, which stand or move as is
    announced. Planner, camera and ground truth have them."""

    def open(self) -> Place:
        """Open the place, with the robot of --robot or of the task, and with the obstacles."""
        place = open_place(self.place, *(() if self.robot is None else (self.robot,)))
        task = self._task(place) if self.robot is None else None
        place = place if task is None else place.with_robot(task.robot)
        if self.obstacles is None:
            return place
        from nerfnav_app.places.obstacles import open_with_obstacles  # slow to import, and seldom needed

        return open_with_obstacles(place, self.obstacles)

    def request(
        self,
        place: Place,
        config: PlannerConfig,
        again: PlannerConfig | None = None,
        flight: NavigateConfig | None = None,
        world: WorldName = "paper",
    ) -> PlanRequest:
        """Make the request for the planner, by its settings for the first plan and in flight (None: its own)."""
        flight = NavigateConfig() if flight is None else flight
        steps = PlanRequest.steps if self.steps is None else self.steps
        dt = PlanRequest.dt if self.dt is None else self.dt
        ends = self._ends(place)
        if place.obstacles is not None:
            from nerfnav_app.places.obstacles import require_clear_ends  # slow to import, as above

            require_clear_ends(place.obstacles, place.robot, ends)
        distance = math.dist(ends.start.position, ends.goal.position)
        unknown = self._task(place) is None or is_hurried(place.robot, distance, steps * dt)
        request = PlanRequest(
            ends,
            steps=steps,
            dt=dt,
            keep_dt=self.dt is not None,
            shortest=self.duration == "auto" or (self.duration is None and self.steps is None and unknown),
            planner=self.planner,
            max_collision=self.max_collision,
            max_blind=self.max_blind,
            unknown=UnknownSpace(self.unknown),
            config=config,
            again=self._replan_settings(config, again),
            paper_cost=self.paper_cost,
            flight=flight,
            world=world,
        )
        return request.lasting(self.duration) if isinstance(self.duration, float) else request

    def _replan_settings(self, config: PlannerConfig, again: PlannerConfig | None) -> PlannerConfig | None:
        """Choose the settings of plans in flight: `again` if it differs from the default, else those that --risk-weight
        makes of the first plan's; None for the default."""
        entry = planners.load(self.planner)
        require_not_negative(risk_weight=self.risk_weight)
        if self.paper_cost and self.risk_weight:
            raise InvalidInputError("--paper-cost counts no risk: leave out --risk-weight, or --paper-cost")
        if again is not None and again != entry.again(entry.config()):
            return again
        return None if self.risk_weight is None else entry.in_flight(config, self.risk_weight)

    def task_name(self, place: Place) -> str | None:
        """Name of the task; None where start and goal are given."""
        task = self._task(place)
        return None if task is None else task.name

    def _task(self, place: Place) -> Task | None:
        """The task; None where a start is given, or no task has the number."""
        number = self.task or 0
        return place.tasks[number] if self.start is None and 0 <= number < len(place.tasks) else None

    def _ends(self, place: Place) -> Ends:
        """Start and goal. Raises InvalidInputError where the arguments do not give both."""
        if self.start is not None and self.goal is not None and self.task is None:
            return Ends(_end_of(self.start), _end_of(self.goal))
        if self.start is not None or self.goal is not None:
            raise InvalidInputError("give either --task, or both --start and --goal")
        if not place.tasks:
            raise InvalidInputError(f"{place.name} has no tasks: give --start and --goal")
        task = self._task(place)
        if task is None:
            raise InvalidInputError(f"{place.name} has tasks 0 to {len(place.tasks) - 1}, not {self.task}")
        return Ends.of_task(task)


def _end_of(read: tuple[float, ...]) -> End:
    return End((read[0], read[1], read[2]), read[3] if len(read) == 4 else 0.0)


def note_move(summary: dict[str, Any]) -> None:
    """Tell the user of the ends that a job has put on the floor."""
    rises = summary.get("ends", {}).get("moved_m", {})
    if rises:
        moved = " and ".join(f"the {end} by {rise:+.2f} m" for end, rise in rises.items())
        note(f"the robot stands on the floor: its height was changed at {moved}")


def note_blindness(summary: dict[str, Any], most: float | None, in_draft: bool) -> None:
    """Tell the user of a plan with too little to see, in a draft or not: more than --max-blind accepts, or anywhere."""
    share = (summary.get("expected_sigma") or {}).get("blind_share", 0.0)
    if share > (most or 0.0):
        note(explain_blindness(share, most, in_draft))


def with_settings(arguments: type[Any], settings: object) -> type[Any]:
    """Add settings, with names as short as its own, to the arguments of a command."""
    config = ("config", Annotated[type(settings), arg(name="")], field(default=settings))
    about = {"__doc__": arguments.__doc__}
    return make_dataclass("Arguments", [config], bases=(arguments,), frozen=True, namespace=about)


def find_planner(words: Sequence[str]) -> PlannerEntry:
    """Find the planner that a command line names. Raises UnknownNameError, which lists the known ones."""
    planner = PLANNER
    for word, following in pairwise([*words, ""]):
        if word == "--planner" or word.startswith("--planner="):
            planner = word.partition("=")[2] or following
    return planners.load(planner)
