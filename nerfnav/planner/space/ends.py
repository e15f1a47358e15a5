"""Ends of a plan: check that a body fits at start and goal, and find the nearest pose where it does."""

from dataclasses import replace

import torch
from torch import Tensor

from nerfnav.core.errors import InvalidInputError, OccupiedError, OutsideBoxError
from nerfnav.field import Field
from nerfnav.geometry import so3
from nerfnav.planner.space.border import is_beyond
from nerfnav.planner.space.occupancy import OccupancyMap, body_density
from nerfnav.planner.space.scales import Scales, scales_of
from nerfnav.robots import Body, RigidState

_CANDIDATES = 500
"""Largest number of free voxels that are tried."""


def check_ends(field: Field, body: Body, start: RigidState, goal: RigidState, occupancy: OccupancyMap) -> None:
    """Refuse ends that no plan can have.

    Raises InvalidInputError for NaN, OutsideBoxError for a point outside the field's box, and OccupiedError for a
    body in density above the map's threshold or partly beyond the border; the latter names the nearest free point.
    """
    for name, state in (("start", start), ("goal", goal)):
        check_finite(name, state)
        if not field.box.contains(state.position):
            raise OutsideBoxError(
                f"the {name} {_words(state.position)} is outside the field, which spans {field.box.describe()}"
            )
        if body_density(field, body, state) > occupancy.scales.threshold:
            nearest = nearest_free_pose(field, body, state, occupancy)
            raise OccupiedError(
                name, _words(state.position), explain_unfit(field, body, state),
                _advice(state, nearest, occupancy.scales),
                None if nearest is None else (
                    nearest.position[0].item(), nearest.position[1].item(), nearest.position[2].item()
                ),
            )  # fmt: skip


def fits(field: Field, body: Body, state: RigidState, threshold: float | None = None) -> bool:
    """Return True if a body can be at a state: all of it in the field's box, and nowhere in a density [1/m] above the
    threshold, by default that of maps."""
    threshold = scales_of(field, body).threshold if threshold is None else threshold
    return body_density(field, body, state) <= threshold


def explain_unfit(field: Field, body: Body, state: RigidState) -> str:
    """Explain in words why a body does not fit at a state, to go on after the name of the state."""
    if is_beyond(field.box, body.points_at(state)).any():
        size = max(body.extents)
        return f"is so near the border of the field that the robot, {size:.3g} m across, would reach beyond it"
    return "is in occupied space"


def check_finite(name: str, state: RigidState) -> None:
    """Raise InvalidInputError where a state holds NaN or infinity."""
    for part in ("position", "velocity", "rotation", "body_rate"):
        if not torch.isfinite(getattr(state, part)).all():
            raise InvalidInputError(f"the {part.replace('_', ' ')} of the {name} must be finite numbers")


def nearest_free_pose(field: Field, body: Body, state: RigidState, occupancy: OccupancyMap) -> RigidState | None:
    """Find the nearest state in which the body fits, turned where the map has headings; None if out of reach.

Its position has as many decimals as users see: whole centimetres for the paper's robot. The attitude of
    `state` comes first, and others only where that fits nowhere within reach.
    """
    count = len(occupancy.by_heading)
    turns = torch.arange(1, count) * (torch.pi / count)
    turned = [replace(state, rotation=so3.from_yaw(turn) @ state.rotation) for turn in turns.to(state.position)]
    return _first_fit(field, body, [state], occupancy, state) or _first_fit(field, body, turned, occupancy, state)


def _first_fit(
    field: Field, body: Body, states: list[RigidState], occupancy: OccupancyMap, near: RigidState
) -> RigidState | None:
    """Find the first of the states in whose attitude the body fits, at the nearest free voxel, rounded as users see
    it."""
    scales, rounding = occupancy.scales, 10**occupancy.scales.decimals
    flat = occupancy.by_heading.shape[-1] == 1  # one height alone: keep it exactly
    for center in occupancy.nearest_free_voxels(near.position, scales.search)[:_CANDIDATES]:
        point = (center * rounding).round() / rounding
        if flat:
            point[2] = near.position[2]
        if field.box.contains(point):
            for there in (replace(state, position=point) for state in states):
                if fits(field, body, there, scales.threshold):
                    return there
    return None


def _advice(state: RigidState, nearest: RigidState | None, scales: Scales) -> str:
    if nearest is None:
        return f"and no free point was found within {scales.search:.3g} m"
    if torch.equal(nearest.rotation, state.rotation):
        return f"the nearest free point is {_words(nearest.position, scales.decimals)}"
    heading = so3.yaw_of(nearest.rotation).item()
    return f"the nearest free pose is {_words(nearest.position, scales.decimals)} with a heading of {heading:.2f} rad"


def _words(point: Tensor, decimals: int = 2) -> str:
    return "(" + ", ".join(f"{number:.{max(2, decimals)}f}" for number in point.tolist()) + ")"
