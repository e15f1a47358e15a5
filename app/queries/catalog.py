"""Catalog of queries: a new kind is a file beside this one and a line here."""

from typing import Any

from app.queries.clearance import ClearanceQuery
from app.queries.click_landing import ClickLandingQuery
from app.queries.density_slice import DensitySliceQuery
from app.queries.end_fit import EndFitQuery
from app.queries.experiments import ExperimentsQuery
from app.queries.field_view import FieldViewQuery
from app.queries.first_ends import FirstEndsQuery
from app.queries.following_plan import FollowingPlanQuery
from app.queries.more_time import MoreTimeQuery
from app.queries.place_list import PlaceListQuery
from app.queries.query import Query
from app.queries.robot_view import RobotViewQuery
from app.queries.run_list import RunListQuery
from app.queries.space import SpaceQuery
from app.queries.stored_run import StoredRunQuery
from app.queries.surface_point import SurfacePointQuery
from app.state.session import Session
from nerfnav.errors import UnknownNameError

_KINDS: list[type[Query[Any]]] = [
    StoredRunQuery,
    RunListQuery,
    PlaceListQuery,
    ClickLandingQuery,
    SurfacePointQuery,
    FirstEndsQuery,
    FollowingPlanQuery,
    EndFitQuery,
    MoreTimeQuery,
    DensitySliceQuery,
    SpaceQuery,
    FieldViewQuery,
    RobotViewQuery,
    ClearanceQuery,
    ExperimentsQuery,
]


_WHILE_HELD = (FollowingPlanQuery, EndFitQuery)
"""What is asked while a hand moves an end: the rest waits until it rests, for nothing must come in between."""


def register(kind: type[Query[Any]]) -> None:
    """Let the worker answer one more kind of query, after the others."""
    if kind not in _KINDS:
        _KINDS.append(kind)


def unregister(kind: type[Query[Any]]) -> None:
    """Ask queries of this kind no longer. Raises UnknownNameError where none are asked."""
    if kind not in _KINDS:
        raise UnknownNameError("query", kind.__name__, (known.__name__ for known in _KINDS))
    _KINDS.remove(kind)


def pending_queries(session: Session) -> tuple[Query[Any], ...]:
    """What is not known yet, the most urgent first."""
    if session.place is None:
        return ()
    kinds = _WHILE_HELD if session.held and session.plan is not None else _KINDS
    return tuple(query for kind in kinds for query in kind.pending(session))
