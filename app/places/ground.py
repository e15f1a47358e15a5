"""Ground of a place: the ends of a robot on the ground are put on the floor, or refused.

Every plan and flight passes here, of the command line and of the page, whatever was opened, chosen or typed in which
order; the page's ends are moved by the same function.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import UnknownSpace
from nerfnav.planner import Footing, OccupancyConfig, Support, settle_ends
from nerfnav.planner.space.ends import check_ends
from nerfnav_app.places.derived import build_occupancy, prepare_place
from nerfnav_app.places.ends import End, EndRole, Ends
from nerfnav_app.places.place import Place


@dataclass(frozen=True)
class GroundedEnds:
    """Ends of a route on the floor."""

    ends: Ends
    """Start and goal; an end that stands already, or is refused, is as it was given."""
    problems: Mapping[EndRole, str] = field(default_factory=dict)
    """Reason why the robot cannot stand at an end, in one sentence."""
    footings: Mapping[EndRole, Footing] = field(default_factory=dict)
    """Footing of a robot on the ground at both ends."""


def find_ground(place: Place, ends: Ends, unknown: UnknownSpace) -> GroundedEnds:
    """Find the floor below both ends; those of a robot that flies stay as they are."""
    if not place.robot.planar:
        return GroundedEnds(ends)
    planning, robot = prepare_place(place, unknown), place.robot
    found = settle_ends(place.field, planning.field, robot, ends.start.state(), ends.goal.state())
    supports = dict(zip(EndRole, found, strict=True))
    for which, support in supports.items():
        ends = ends.moved(which, _on_floor(ends.of(which), support))
    problems = {which: support.problem(robot.name, which.value) for which, support in supports.items()}
    return GroundedEnds(
        ends,
        {which: text for which, text in problems.items() if text is not None},
        {which: support.footing for which, support in supports.items()},
    )


def put_on_ground(place: Place, ends: Ends, unknown: UnknownSpace) -> Ends:
    """Put both ends on the floor.

    Raises InvalidInputError, which says why, where the robot cannot stand; OutsideBoxError or OccupiedError for an end
    outside of the field or in something.
    """
    grounded = find_ground(place, ends, unknown)
    for text in grounded.problems.values():
        raise InvalidInputError(text)
    if Footing.NOT_JUDGED in grounded.footings.values():
        # a later check would complain of the heights first, one of which is now that of the floor
        planning, (start, goal) = prepare_place(place, unknown), (grounded.ends.of(which).state() for which in EndRole)
        occupancy = build_occupancy(planning, OccupancyConfig(), start.position[2].item())
        check_ends(planning.field, place.robot.body, start, goal, occupancy)
    return grounded.ends


def describe_move(given: Ends, ends: Ends) -> dict[str, Any]:
    """Describe how far ends were moved onto the floor, as `--json` prints it: nothing where none was."""
    if given == ends:
        return {}
    positions = {which.value: list(ends.of(which).position) for which in EndRole}
    rises = {which.value: ends.of(which).position[2] - given.of(which).position[2] for which in EndRole}
    return {"ends": positions | {"moved_m": {name: round(rise, 4) for name, rise in rises.items() if rise}}}


def _on_floor(end: End, support: Support) -> End:
    """Move an end to the height of its support."""
    if support.footing is not Footing.MOVED:
        return end
    x, y, _ = end.position
    return replace(end, position=(x, y, round(support.state.position[2].item(), 4)))
