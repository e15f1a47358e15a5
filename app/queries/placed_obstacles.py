"""Queries for obstacles: the place with those of the page in it, and the position at which a click places a new one."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import Field, GridField
from nerfnav.obstacles import ObstacleSet, require_placeable
from nerfnav.planner import planners
from nerfnav.robots import RigidState
from nerfnav_app.places.obstacles import find_touched, place_obstacles, require_standing, take_up
from nerfnav_app.places.place import Place
from nerfnav_app.queries.click_landing import intersect_ray
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.reducers.common import add_notice
from nerfnav_app.reducers.obstacles import add_obstacle
from nerfnav_app.state.alignment import Vector
from nerfnav_app.state.obstacles import ObstacleKind, PlacedObstacle, free_name, new_obstacle
from nerfnav_app.state.place import Click
from nerfnav_app.state.session import Session

_OF_THE_ROBOT = 2.5
"""Size of a new obstacle, in lengths of the robot."""


@dataclass(frozen=True)
class ObstaclesPlaced:
    """A place with the obstacles that could be placed."""

    place: Place
    """The place with them."""
    problems: Mapping[str, str]
    """Why each of the others was left out, one sentence, by its name."""


@dataclass(frozen=True)
class PlacedObstaclesQuery(Query[ObstaclesPlaced]):
    """Query for the place with the obstacles of the page, in its map and in its ground truth."""

    obstacles: tuple[PlacedObstacle, ...]
    """Obstacles that are not hidden."""
    in_hand: str | None = None
    """Name of the one that the user drags, where the planner takes it for one that moves."""
    robot_at: RigidState | None = field(default=None, compare=False)
    """True state of a robot that flies, on which none is dropped."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["PlacedObstaclesQuery"]:
        """Ask where the obstacles of the page are not those of the place."""
        place, wanted = session.place, session.visible_obstacles
        if place is not None and (wanted or place.obstacles is not None):
            flown = session.flight.steps[-1:] if session.flight is not None and session.in_flight else ()
            in_hand = session.in_hand if planners.load(session.choice.planner).avoids_movers else None
            yield cls(wanted, in_hand, flown[0].truth if flown else None)

    def answer(self, resources: Resources) -> ObstaclesPlaced:
        """Place all that can be placed: a field on a grid holds those inside it, but for the one in a hand."""
        bare, problems, fitting = resources.place.without_obstacles(), dict[str, str](), []
        for placed in self.obstacles:
            try:
                self._check(placed, bare)
                fitting.append(take_up(placed.obstacle) if placed.name == self.in_hand else placed.obstacle)
            except InvalidInputError as error:
                problems[placed.name] = str(error)
        placed = ObstacleSet(tuple(fitting))
        place = place_obstacles(bare, placed, resources.place) if fitting else bare
        return ObstaclesPlaced(place, problems)

    def _check(self, placed: PlacedObstacle, bare: Place) -> None:
        require_standing(placed.obstacle)
        require_placeable(bare.field, placed.obstacle)
        if self.robot_at is not None and find_touched([placed.obstacle], bare.robot, self.robot_at) is not None:
            raise InvalidInputError(f"the obstacle {placed.name!r} is where the robot flies: move it away")

    def apply(self, session: Session, result: ObstaclesPlaced) -> Session:
        """Take the place: what was computed in the one before is asked again, plans and flights stay."""
        place = session.place
        if place is None or place.without_obstacles().field is not result.place.without_obstacles().field:
            return session  # another place was opened, or a better field taken
        there = replace(result.place, robot=place.robot)
        kept = {slot: pair for slot, pair in session.results.items() if pair[0] is None or not pair[0].reads_field}
        known = {slot: (None, pair[1]) for slot, pair in session.results.items() if slot not in kept}
        flight = session.flight
        if flight is not None and session.in_flight:
            flight = replace(flight, obstacles=there.obstacles)
        changed = replace(session, place=there, flight=flight, results={**kept, **known}, problems={}, offers={})
        return super().apply(changed, result)


@dataclass(frozen=True)
class ObstacleLandingQuery(Query[PlacedObstacle | None]):
    """Query for a new obstacle where a click points, on the surface that its ray meets; None without one."""

    click: Click
    kind: ObstacleKind
    name: str
    """Name of the new obstacle."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["ObstacleLandingQuery"]:
        """Ask while an obstacle waits for its click."""
        click = session.clicked
        if click is not None and isinstance(click.which, ObstacleKind):
            yield cls(click, click.which, free_name(session.obstacles, click.which.value))

    def answer(self, resources: Resources) -> PlacedObstacle | None:
        """Let it touch the surface with its side, along the axis that is nearest to the normal there; a volume that
        selects has its middle there."""
        place = resources.place
        met = intersect_ray(place.field, self.click.ray)
        if met is None:
            return None
        size = _OF_THE_ROBOT * max(place.robot.body.extents)
        center = np.array(met)
        if not self.kind.selects:
            center += 0.5 * size * _side_of(place.field, met, self.click.ray.direction)
        x, y, z = center.round(4).tolist()
        return new_obstacle(self.kind, self.name, size, (x, y, z))

    def apply(self, session: Session, result: PlacedObstacle | None) -> Session:
        """Place it, unless another click came."""
        if session.clicked != self.click:
            return session
        done = replace(session, clicked=None)
        if result is None:
            text = f"The click met nothing to put the {self.kind.value} on."
            return add_notice(done, "Nothing there", text, bad=True)
        return add_obstacle(done, result)


def _side_of(field: Field, met: Vector, along: Vector) -> np.ndarray:
    """Find the axis, with its sign, that is nearest to the normal of a surface, seen along a ray."""
    seen = -np.array(along) / np.linalg.norm(along)
    normal = seen
    if isinstance(field, GridField):
        steps = field.resolution * np.stack(np.meshgrid(*[np.arange(-2, 3)] * 3, indexing="ij"), -1).reshape(-1, 3)
        density, _ = field.density_and_gradient(np.array(met) + steps)
        away = -(density.clip(max=field.solid_density) @ steps)  # out of what is dense around the point
        normal = away if away @ seen > 0 else seen
    axis = int(np.abs(normal).argmax())
    return np.eye(3)[axis] * np.sign(normal[axis])
