"""What planners make of a field: space that is not proven free counts as solid, unless they are told otherwise."""

from dataclasses import replace
from enum import Enum

from nerfnav.field.composite import CompositeField
from nerfnav.field.field import Field
from nerfnav.field.grid_field import GridField


class Unknown(Enum):
    """What planners take unproven space for."""

    OCCUPIED = "occupied"
    """As solid: a hollow stone is no corridor, and a plain wall may be anywhere."""
    FREE = "free"
    """As the field says."""


def planning_field(field: Field, unknown: Unknown) -> Field:
    """What to plan in: `field` with nothing in it where that is proven, and its unproven nodes solid or as they are.

    Made once for each field. Fields without evidence stay as they are; of a composite field this is said for each
    part.
    """
    if isinstance(field, CompositeField):
        return CompositeField(tuple(replace(part, field=planning_field(part.field, unknown)) for part in field.parts))
    if not isinstance(field, GridField) or field.evidence is None:
        return field
    return field.planned if unknown is Unknown.OCCUPIED else field.planned_as_it_says
