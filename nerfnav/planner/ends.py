"""Whether a start and a goal can be planned between, and what to say where they cannot."""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.errors import InvalidInputError, OccupiedError, OutsideBoxError
from nerfnav.field.field import Field
from nerfnav.planner.occupancy import OccupancyMap, body_density
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
            nearest = nearest_free(field, body, state, occupancy)
            advice = f"the nearest free point is {_words(nearest)}" if nearest is not None else (
                f"and no free point was found within {_SEARCH_REACH:g} m"
            )  # fmt: skip
            point = None if nearest is None else (nearest[0].item(), nearest[1].item(), nearest[2].item())
            raise OccupiedError(f"the {name} {_words(state.position)} is in occupied space; {advice}", point)


def check_finite(name: str, state: RigidState) -> None:
    """Raise InvalidInputError where a state holds NaN or infinity."""
    for part in ("position", "velocity", "rotation", "body_rate"):
        if not torch.isfinite(getattr(state, part)).all():
            raise InvalidInputError(f"the {part.replace('_', ' ')} of the {name} must be finite numbers")


def nearest_free(
    field: Field, body: Body, state: RigidState, occupancy: OccupancyMap
) -> Float[Tensor, "3"] | None:
    """The nearest point, in whole centimetres, where the body fits in the attitude of `state`; None if out of reach."""
    for center in occupancy.nearest_free_voxels(state.position, _SEARCH_REACH)[:_CANDIDATES]:
        point = (center * 100).round() / 100
        moved = RigidState(point, state.velocity, state.rotation, state.body_rate)
        fits = body_density(field, body, moved) <= occupancy.config.threshold
        if fits and field.box.contains(point):
            return point
    return None


def _words(point: Tensor) -> str:
    return "(" + ", ".join(f"{number:.2f}" for number in point.tolist()) + ")"
