"""Query for the floor below the ends of a robot on the ground, and for its fit there."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from nerfnav.field import UnknownSpace
from nerfnav_app.places.ends import EndRole, Ends
from nerfnav_app.places.ground import find_ground
from nerfnav_app.queries.end_fit import EndFit, check_fit
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.reducers.common import move_ends
from nerfnav_app.state.session import Session


@dataclass(frozen=True)
class GroundFit:
    """Ends on the floor, and the fit of the robot there."""

    ends: Ends
    """Start and goal on the floor."""
    fits: Mapping[EndRole, EndFit] = field(default_factory=dict)
    """Fit at each of them: a problem where no floor carries the robot, too."""


@dataclass(frozen=True)
class GroundQuery(Query[GroundFit]):
    """Query for the floor below both ends, which a robot on the ground has at one height."""

    ends: Ends
    robot: str
    unknown: UnknownSpace = UnknownSpace.OCCUPIED
    """Treatment of unseen space."""
    held: bool = False
    """True while the user drags an end, which stays in the hand."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["GroundQuery"]:
        """Ask for ends of a robot on the ground that were not checked at their present poses."""
        planar = session.place is not None and session.place.robot.planar
        if planar and not session.seeking and any(which not in session.problems for which in EndRole):
            yield cls._of(session)

    @classmethod
    def _of(cls, session: Session) -> "GroundQuery":
        return cls(session.ends, session.choice.robot, session.plan_settings.unknown, session.held)

    def answer(self, resources: Resources) -> GroundFit:
        """Find the floor, then check the density at all body points, as plans do."""
        found = find_ground(resources.place, self.ends, self.unknown)
        return GroundFit(
            found.ends,
            {
                which: EndFit(f"{found.problems[which]}.") if which in found.problems
                else check_fit(resources.place, which, found.ends.of(which), self.unknown)
                for which in EndRole
            },
        )  # fmt: skip

    def apply(self, session: Session, result: GroundFit) -> Session:
        """Move the ends onto the floor, unless they were moved meanwhile; offer it while they must stay.

        They stay while the user drags one, and where a stored flight is shown, which has begun there.
        """
        if session.seeking or self._of(session) != self:
            return session
        problems = {which: fit.problem for which, fit in result.fits.items()}
        offers = {which: fit.offer for which, fit in result.fits.items() if fit.offer is not None}
        if self.held:
            return replace(session, problems=problems, offers={})
        if session.flight_is_shown and not session.in_flight:
            moved = {which: result.ends.of(which) for which in EndRole if result.ends.of(which) != self.ends.of(which)}
            problems |= {which: f"the {which.value} is in the air." for which in moved if problems[which] is None}
            return replace(session, problems=problems, offers=offers | moved)
        return replace(move_ends(session, result.ends), problems=problems, offers=offers)
