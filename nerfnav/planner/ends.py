"""Whether a start and a goal can be planned between, and what to say where they cannot."""

from dataclasses import replace

import torch
from torch import Tensor

from nerfnav.errors import InvalidInputError, OccupiedError, OutsideBoxError
from nerfnav.field.field import Field
from nerfnav.geometry import so3
from nerfnav.planner.occupancy import OccupancyConfig, OccupancyMap, body_density
from nerfnav.robots.body import Body
from nerfnav.robots.state import RigidState

_SEARCH_REACH = 1.0
"""How far from an occupied end [m] a free point is looked for."""
_CANDIDATES = 500
"""How many free voxels are tried at most."""


def check_ends(field: Field, body: Body, start: RigidState, goal: RigidState, occupancy: OccupancyMap) -> None:
    """Refuse ends that no plan can have.

    Raises InvalidInputError for NaN, OutsideBoxError for a point outside the field's box, and OccupiedError for a
    body in density above the map's threshold; the latter names the nearest free point.
    """
    for name, state in (("start", start), ("goal", goal)):
        check_finite(name, state)
        if not field.box.contains(state.position):
            raise OutsideBoxError(
                f"the {name} {_words(state.position)} is outside the field, which spans {field.box.describe()}"
            )
        if body_density(field, body, state) > occupancy.config.threshold:
            nearest = nearest_free_pose(field, body, state, occupancy)
            raise OccupiedError(
                f"the {name} {_words(state.position)} is in occupied space; {_advice(state, nearest)}",
                None if nearest is None else (
                    nearest.position[0].item(), nearest.position[1].item(), nearest.position[2].item()
                ),
            )  # fmt: skip


def fits(field: Field, body: Body, state: RigidState, threshold: float = OccupancyConfig.threshold) -> bool:
    """Whether a body can be at a state: it is nowhere in a density [1/m] above the threshold, as maps have it."""
    return body_density(field, body, state) <= threshold


def check_finite(name: str, state: RigidState) -> None:
    """Raise InvalidInputError where a state holds NaN or infinity."""
    for part in ("position", "velocity", "rotation", "body_rate"):
        if not torch.isfinite(getattr(state, part)).all():
            raise InvalidInputError(f"the {part.replace('_', ' ')} of the {name} must be finite numbers")


def nearest_free_pose(field: Field, body: Body, state: RigidState, occupancy: OccupancyMap) -> RigidState | None:
    """The nearest state in which the body fits, turned where the map tells headings apart; None if out of reach.

    Its position is in whole centimetres. The attitude of `state` comes first, and others only where that fits nowhere
    within reach.
    """
    count = len(occupancy.by_heading)
    turns = torch.arange(1, count) * (torch.pi / count)
    turned = [replace(state, rotation=so3.from_yaw(turn) @ state.rotation) for turn in turns.to(state.position)]
    for tried in ((state,), tuple(turned)):
        nearest = _first_fit(field, body, tried, occupancy, state)
        if nearest is not None:
            return nearest
    return None


def _first_fit(
    field: Field, body: Body, states: tuple[RigidState, ...], occupancy: OccupancyMap, near: RigidState
) -> RigidState | None:
    """The first of the states in whose attitude the body fits, at the nearest free voxel, in whole centimetres."""
    flat = occupancy.by_heading.shape[-1] == 1  # one height alone: keep it exactly
    for center in occupancy.nearest_free_voxels(near.position, _SEARCH_REACH)[:_CANDIDATES]:
        point = (center * 100).round() / 100
        if flat:
            point[2] = near.position[2]
        if field.box.contains(point):
            for there in (replace(state, position=point) for state in states):
                if fits(field, body, there, occupancy.config.threshold):
                    return there
    return None


def _advice(state: RigidState, nearest: RigidState | None) -> str:
    if nearest is None:
        return f"and no free point was found within {_SEARCH_REACH:g} m"
    if torch.equal(nearest.rotation, state.rotation):
        return f"the nearest free point is {_words(nearest.position)}"
    heading = so3.yaw_of(nearest.rotation).item()
    return f"the nearest free pose is {_words(nearest.position)} with a heading of {heading:.2f} rad"


def _words(point: Tensor) -> str:
    return "(" + ", ".join(f"{number:.2f}" for number in point.tolist()) + ")"
