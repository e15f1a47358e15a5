"""Crop a field: keep the nodes in a smaller box as they are. The rest is dropped, or joins the surroundings."""

from dataclasses import replace

import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.core.codec import StoredField
from nerfnav.field.edit.resample import resample_surroundings
from nerfnav.field.models.neural import NeuralField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import Box, Similarity

_FEWEST = 4
"""Fewest nodes along each edge of a cropped field."""


def intersect_boxes(box: Box, whole: Box) -> Box:
    """The part of a box that lies in the `whole` place. Raises InvalidInputError where there is none."""
    inner = Box(torch.maximum(box.lower, whole.lower), torch.minimum(box.upper, whole.upper))
    if not bool((inner.size > 0).all()):
        raise InvalidInputError(f"the box {box.describe()} lies outside the place, which is {whole.describe()}")
    return inner


def crop_field(field: StoredField, box: Box) -> StoredField:
    """Cut `field` to `box` [m]; of a voxel field the nodes in it are kept, to the nearest one.

    A field with surroundings keeps what is cut off as part of them, so that pictures still show it. Raises
    InvalidInputError where the box holds next to nothing of the field, and for fields of other kinds.
    """
    inner = intersect_boxes(box, field.box)
    if isinstance(field, NeuralField):
        return replace(field, box=inner)
    if not isinstance(field, VoxelField):
        raise InvalidInputError(f"a {type(field).__name__} cannot be cropped: bake it first, with nerfnav bake")
    first = ((inner.lower - field.box.lower) / field.spacing).round().long()
    last = ((inner.upper - field.box.lower) / field.spacing).round().long()
    if bool((last - first + 1 < _FEWEST).any()):
        raise InvalidInputError(
            f"the box {box.describe()} holds less than {_FEWEST} voxels of {field.resolution:.3g} m along an edge: "
            "choose a larger one"
        )
    kept = tuple(slice(int(low), int(high) + 1) for low, high in zip(first, last, strict=True))
    lower, upper = field.box.lower + first * field.spacing, field.box.lower + last * field.spacing
    # the border itself, without rounding
    whole = torch.tensor(field.shape) - 1
    inner = Box(torch.where(first == 0, field.box.lower, lower), torch.where(last == whole, field.box.upper, upper))
    return replace(
        field,
        box=inner,
        values=field.values[kept].contiguous(),
        evidence=None if field.evidence is None else field.evidence[kept].contiguous(),
        outside=resample_surroundings(field, inner, Similarity.identity()),
    )
