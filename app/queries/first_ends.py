"""Query for a first start and goal in a place without a task for the robot."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch

from nerfnav.core.errors import NerfnavError
from nerfnav.estimator import decode_views
from nerfnav.field import UnknownSpace
from nerfnav.importers import focus_of
from nerfnav.planner import OccupancyConfig, threshold_of
from nerfnav.planner.space.occupancy import dense_at
from nerfnav_app.places.derived import build_occupancy, prepare_place
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.place import Place
from nerfnav_app.places.vantage import View, view_of_ends, view_of_subject
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.reducers.common import add_notice
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import to_point


@dataclass(frozen=True)
class FirstEnds:
    """Start and goal between which the robot can plan."""

    ends: Ends | None
    """Start and goal; None without room."""
    problem: str | None = None
    """Reason for which there are none, in one sentence."""
    view: View | None = None
    """View in which both are visible."""


@dataclass(frozen=True)
class FirstEndsQuery(Query[FirstEnds]):
    """Query for a start and a goal of this robot."""

    robot: str

    @classmethod
    def pending(cls, session: Session) -> Iterator["FirstEndsQuery"]:
        """Ask while ends are searched: the place has no task for the robot, and the user has not moved them."""
        if session.seeking:
            yield cls(session.choice.robot)

    def answer(self, resources: Resources) -> FirstEnds:
        """Search the free space that planners see."""
        from nerfnav.planner.objective.default_ends import propose_ends  # slow to import, and bundled places have tasks

        place = resources.place
        seen = prepare_place(place, UnknownSpace.OCCUPIED)
        try:
            found = propose_ends(
                seen.field, place.field, place.robot, lambda height: build_occupancy(seen, OccupancyConfig(), height)
            )
        except NerfnavError as error:
            return FirstEnds(None, str(error))
        if found is None:
            return FirstEnds(None, _no_room(place))
        ends = Ends(*map(End.of_state, found))
        return FirstEnds(ends, view=find_view(place, ends))

    def apply(self, session: Session, result: FirstEnds) -> Session:
        """Take these ends, and find durations from now on, unless the user has moved an end meanwhile."""
        if not session.seeking or session.choice.robot != self.robot:
            return session
        session = replace(session, seeking=False, plan_settings=replace(session.plan_settings, shortest=True))
        if result.ends is None:
            return add_notice(session, "Nowhere to go", result.problem or "", bad=True)
        view = result.view or session.view
        return replace(session, ends=result.ends, home_ends=result.ends, view=view, problems={}, offers={}, outside={})


def find_view(place: Place, ends: Ends) -> View:
    """Find a view in which start and goal are visible: that of the photographs, if they face a subject."""
    box, threshold = place.field.box, threshold_of(place.field)
    lower, upper = box.lower.tolist(), box.upper.tolist()

    def is_dense(points: np.ndarray) -> np.ndarray:
        inside = ((points >= lower) & (points <= upper)).all(-1)
        dense = dense_at(place.field, torch.from_numpy(points.clip(lower, upper)).float(), threshold)
        return inside & dense.bool().numpy()

    photographed = _photographed(place.field.info.views)
    return view_of_ends(ends.start.position, ends.goal.position, (tuple(lower), tuple(upper)), is_dense, photographed)


def _photographed(views: tuple[float, ...]) -> View | None:
    """Find the view that the photographs with these poses show; None where they face outwards or are unknown."""
    if not views:
        return None
    poses = decode_views(views)
    matrices = np.tile(np.eye(4), (len(poses.position), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = poses.rotation.numpy(), poses.position.numpy()
    focus = focus_of(matrices)
    return view_of_subject(to_point(focus.point), matrices[:, :3, 3]) if focus.inwards else None


def _no_room(place: Place) -> str:
    """Explain that there is no room for a robot."""
    size = " x ".join(f"{edge:.2g}" for edge in place.field.box.size.tolist())
    length = max(place.robot.body.extents)
    lacks = "no level ground that is known to be free" if place.robot.planar else "no free space to go anywhere"
    return (
        f"There is {lacks} for a {place.robot.name}, {100 * length:.3g} cm long, in this place of {size} m: choose "
        "another robot, or say how long a metre is there."
    )
