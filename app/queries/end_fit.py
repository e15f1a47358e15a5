"""Query for the fit of the robot at an end."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from nerfnav.field import UnknownSpace
from nerfnav.geometry import so3
from nerfnav.planner import OccupancyConfig, fits, nearest_free_pose
from nerfnav_app.places.derived import build_occupancy, explain_unfit_in, prepare_place
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.places.obstacles import find_touched
from nerfnav_app.places.place import Place
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.session import Session


@dataclass(frozen=True)
class EndFit:
    """Fit of the robot at an end."""

    problem: str | None
    """One sentence; None where the robot fits."""
    offer: End | None = None
    """The nearest end at which the robot fits, where it does not fit here."""


def check_fit(seen: Place, which: EndRole, end: End, unknown: UnknownSpace = UnknownSpace.OCCUPIED) -> EndFit:
    """Check the fit of a place's robot at an end, with unknown space as planners take it."""
    place = prepare_place(seen, unknown)
    body, state, name = place.robot.body, end.state(), which.value
    placed = () if place.obstacles is None else place.obstacles.obstacles
    occupancy = build_occupancy(place, OccupancyConfig(), end.position[2])
    if fits(place.field, body, state, occupancy.scales.threshold):
        movers = [obstacle for obstacle in placed if obstacle.moves and which is EndRole.START]
        met = find_touched(movers, place.robot, state)
        return EndFit(None if met is None else f"the {name} is where the obstacle {met.name!r} is at take-off.")
    nearest, wrong = nearest_free_pose(place.field, body, state, occupancy), explain_unfit_in(seen, state, unknown)
    standing = [obstacle for obstacle in placed if not obstacle.moves]
    if (touched := find_touched(standing, place.robot, state)) is not None:
        wrong = f"is where the obstacle {touched.name!r} stands"
    if nearest is None:
        return EndFit(f"the {name} {wrong}, far from any free point.")
    x, y, z = nearest.position.tolist()
    problem = f"the {name} {wrong}; the nearest free point is ({x:.2f}, {y:.2f}, {z:.2f})."
    return EndFit(problem, End((x, y, z), so3.yaw_of(nearest.rotation).item()))


@dataclass(frozen=True)
class EndFitQuery(Query[EndFit]):
    """Query for the fit of a robot that flies at this end; of others see ground.py."""

    which: EndRole
    end: End
    unknown: UnknownSpace = UnknownSpace.OCCUPIED
    """Treatment of unseen space."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["EndFitQuery"]:
        """Ask for each end that was not checked at its present pose, once first ends are found."""
        if session.place is None or session.seeking or session.place.robot.planar:  # see ground.py
            return
        for which in EndRole:
            if which not in session.problems:
                yield cls(which, session.ends.of(which), session.plan_settings.unknown)

    def answer(self, resources: Resources) -> EndFit:
        """Check the density at all body points, as plans do."""
        return check_fit(resources.place, self.which, self.end, self.unknown)

    def apply(self, session: Session, result: EndFit) -> Session:
        """Keep the problem of the end, unless the end was moved meanwhile."""
        if (session.ends.of(self.which), session.plan_settings.unknown) != (self.end, self.unknown):
            return session
        known = replace(session, problems={**session.problems, self.which: result.problem})
        if result.offer is None:
            return known
        return replace(known, offers={**session.offers, self.which: result.offer})
