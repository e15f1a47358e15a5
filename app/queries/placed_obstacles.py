"""Queries for obstacles: the place with those of the page in it, and the position at which a click places a new one, or
the next point of a path."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import Field, GridField
from nerfnav.obstacles import ObstacleSet, find_part, require_placeable
from nerfnav.planner import planners
from nerfnav.robots import RigidState
from nerfnav_app.places.obstacles import find_touched, place_obstacles, take_up
from nerfnav_app.places.place import Place
from nerfnav_app.queries.click_landing import intersect_ray
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.reducers.common import add_notice
from nerfnav_app.reducers.obstacles import add_obstacle, add_way_point
from nerfnav_app.state.alignment import Vector
from nerfnav_app.state.obstacles import ObstacleKind, PathPoint, PlacedObstacle, free_name, new_obstacle
from nerfnav_app.state.place import Click
from nerfnav_app.state.session import Session
from nerfnav_app.text import sentence

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
    time: float = field(default=0.0, compare=False)
    """Time of the flight then [s]."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["PlacedObstaclesQuery"]:
        """Ask where the obstacles of the page are not those of the place."""
        place, wanted = session.place, session.visible_obstacles
        if place is not None and (wanted or place.obstacles is not None):
            flown = session.flight.steps[-1:] if session.flight is not None and session.in_flight else ()
            counts = session.held and planners.load(session.choice.planner).avoids_movers
            at, time = (flown[0].truth, flown[0].time) if flown else (None, 0.0)
            yield cls(wanted, session.in_hand if counts else None, at, time)

    def answer(self, resources: Resources) -> ObstaclesPlaced:
        """Place all that can be placed: a field on a grid holds those inside it, but for the one in a hand."""
        bare, problems, fitting = resources.place.without_obstacles(), dict[str, str](), []
        for placed in self.obstacles:
            try:
                self._check(placed, resources.place)
                fitting.append(take_up(placed.obstacle) if placed.name == self.in_hand else placed.obstacle)
            except InvalidInputError as error:
                problems[placed.name] = str(error)
        placed = ObstacleSet(tuple(fitting))
        place = place_obstacles(bare, placed, resources.place) if fitting else bare
        return ObstaclesPlaced(place, problems)

    def _check(self, placed: PlacedObstacle, place: Place) -> None:
        if not placed.moves:
            require_placeable(place.without_obstacles().field, placed.obstacle)
        robot, at = place.robot, self.robot_at
        if at is not None and placed.entry.seen and not place.has_seen:
            raise InvalidInputError(
                f"the obstacle {placed.name!r} is not announced, and this robot does not look for such: place it "
                "before take-off, or announce it"
            )
        if at is not None and find_touched([placed.obstacle], robot, at, self.time) is not None:
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
class ObstacleLandingQuery(Query[PlacedObstacle | str]):
    """Query for a new obstacle where a click points, on the surface that its ray meets; or why there is none."""

    click: Click
    kind: ObstacleKind
    name: str
    """Name of the new obstacle."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["ObstacleLandingQuery"]:
        """Ask while an obstacle waits for its click."""
        click = session.clicked
        if click is not None and isinstance(click.which, ObstacleKind):
            kind = ObstacleKind.BOX_VOLUME if click.which is ObstacleKind.CLICKED_PART else click.which
            yield cls(click, click.which, free_name(session.obstacles, kind.value))

    def answer(self, resources: Resources) -> PlacedObstacle | str:
        """Let it touch the surface with its side, along the axis that is nearest to the normal there; a volume that
        selects has its middle there, or is as large as the clicked part."""
        place = resources.place
        met = intersect_ray(place.field, self.click.ray)
        if met is None:
            return f"The click met nothing to put the {self.kind.value} on: click onto a surface."
        size = _OF_THE_ROBOT * max(place.robot.body.extents)
        if self.kind is ObstacleKind.CLICKED_PART:
            if not isinstance(place.field, GridField):
                return "Parts are cut out of fields on a grid: bake this one first, with nerfnav bake."
            try:
                part = find_part(place.field, met)
            except InvalidInputError as error:
                return sentence(str(error))
            volume = new_obstacle(self.kind, self.name, size, part.position)
            return volume.changed(box=part.extents, rotation=(0.0, 0.0, part.yaw))
        center = np.array(met)
        if not self.kind.selects:
            center += 0.5 * size * _side_of(place.field, met, self.click.ray.direction)
        x, y, z = center.round(4).tolist()
        return new_obstacle(self.kind, self.name, size, (x, y, z))

    def apply(self, session: Session, result: PlacedObstacle | str) -> Session:
        """Place it, unless another click came."""
        if session.clicked != self.click:
            return session
        done = replace(session, clicked=None)
        if isinstance(result, str):
            return add_notice(done, "Not placed", result, bad=True)
        return add_obstacle(done, result)


@dataclass(frozen=True)
class WayPointQuery(Query[Vector | None]):
    """Query for the way point [m] that a click adds to a path; None where the click points nowhere."""

    click: Click
    name: str
    """The obstacle that moves along the path."""
    height: float
    """Height of the obstacle [m], which it keeps."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["WayPointQuery"]:
        """Ask for a click while a path is drawn."""
        click, placed = session.clicked, session.drawing
        if click is not None and click.which is PathPoint.NEXT and placed is not None:
            yield cls(click, placed.name, placed.entry.position[2])

    def answer(self, resources: Resources) -> Vector | None:
        """Go to where the ray passes the height of the obstacle or, before that, below or above where it meets a
        surface."""
        ray = self.click.ray
        start, along = np.array(ray.origin), np.array(ray.direction) / np.linalg.norm(ray.direction)
        met, fall = intersect_ray(resources.place.field, ray), (self.height - start[2]) * along[2]
        far = (self.height - start[2]) / along[2] if fall > 0 else np.inf
        near = np.inf if met is None else float(np.linalg.norm(np.array(met) - start))
        if not np.isfinite(min(far, near)):
            return None
        x, y, _ = (start + min(far, near) * along).round(4).tolist()
        return x, y, self.height

    def apply(self, session: Session, result: Vector | None) -> Session:
        """Add it, unless another click came or the path has ended."""
        placed, place = session.drawing, session.place
        if session.clicked != self.click or place is None:
            return session
        done = replace(session, clicked=None)
        if placed is None or placed.name != self.name:
            return done
        if result is None:
            return add_notice(done, "Nothing there", "The click points at nothing: click inside the place.", bad=True)
        return add_way_point(done, place, placed, result)


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
