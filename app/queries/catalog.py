"""Catalog of queries: a new kind is a file beside this one and a line here."""

from typing import Any

from nerfnav.core.errors import UnknownNameError
from nerfnav_app.queries import (
    better_field,
    clearance,
    click_landing,
    density_slice,
    end_fit,
    experiments,
    field_view,
    first_ends,
    following_plan,
    ground,
    place_list,
    placed_obstacles,
    robot_view,
    run_list,
    space,
    stored_run,
    surface_point,
    surface_texture,
)
from nerfnav_app.queries.query import Query
from nerfnav_app.state.session import Session

_KINDS: list[type[Query[Any]]] = [
    first_ends.FirstEndsQuery,  # before it is answered, nothing can be begun
    stored_run.StoredRunQuery,
    run_list.RunListQuery,
    place_list.PlaceListQuery,
    click_landing.ClickLandingQuery,
    placed_obstacles.ObstacleLandingQuery,
    placed_obstacles.WayPointQuery,
    placed_obstacles.PlacedObstaclesQuery,  # which changes what plans are made in
    ground.GroundQuery,  # which moves the ends of plans
    surface_point.SurfacePointQuery,
    surface_point.FloorQuery,
    following_plan.FollowingPlanQuery,
    end_fit.EndFitQuery,
    following_plan.MoreTimeQuery,
    density_slice.DensitySliceQuery,
    space.SpaceQuery,
    field_view.FieldViewQuery,
    robot_view.RobotViewQuery,
    clearance.ClearanceQuery,
    experiments.ExperimentsQuery,
    better_field.BetterFieldQuery,
    surface_texture.SurfaceTextureQuery,
]


_WHILE_HELD = (
    following_plan.FollowingPlanQuery, placed_obstacles.PlacedObstaclesQuery, end_fit.EndFitQuery, ground.GroundQuery
)  # fmt: skip
"""Queries while the user drags an end or an obstacle; all others wait. The plan follows an obstacle to where it is
placed before the obstacle is placed again, where the hand is by then."""


def register(kind: type[Query[Any]]) -> None:
    """Register one more kind of query, after the others."""
    if kind not in _KINDS:
        _KINDS.append(kind)


def unregister(kind: type[Query[Any]]) -> None:
    """Unregister a kind of query. Raises UnknownNameError for a kind that is not registered."""
    if kind not in _KINDS:
        raise UnknownNameError("query", kind.__name__, (known.__name__ for known in _KINDS))
    _KINDS.remove(kind)


def pending_queries(session: Session) -> tuple[Query[Any], ...]:
    """List the wanted queries whose answer is not kept, the most urgent first."""
    if session.place is None:
        return ()
    kinds = _WHILE_HELD if session.held and session.plan is not None else _KINDS
    return tuple(query for kind in kinds for query in kind.pending(session) if not query.is_answered(session))
