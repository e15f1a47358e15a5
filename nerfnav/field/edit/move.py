"""Move a field by a similarity transform of the world, without training again.

Notation: p' = s R p + t. A ray that loses some light over a length d loses it over s d afterwards, so densities are
rho' = rho / s; colours stay. Translations, scales and quarter turns take nodes to nodes. Any other rotation puts the
nodes of the new grid between those of the old one: see resample.py.
"""

from collections.abc import Generator
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.core.codec import StoredField
from nerfnav.field.core.occupancy import DENSITY_SCALE, raw_of
from nerfnav.field.edit.bake import EditStep
from nerfnav.field.edit.conservative_occupancy import least_solid_raw, preserve_occupancy
from nerfnav.field.edit.resample import resample_field
from nerfnav.field.models.levels import raw_of as raws_of
from nerfnav.field.models.neural import NeuralField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.surroundings import Surroundings
from nerfnav.geometry import Box, Pose, Similarity


def move_field(field: StoredField, similarity: Similarity) -> Generator[EditStep, None, StoredField]:
    """Move a field of voxels or of networks.

    What is solid or unproven for planners before is so afterwards. Raises InvalidInputError for fields of other kinds,
    and where a turned grid would be too large.
    """
    yield EditStep("moving the field", 0.0)
    if isinstance(field, NeuralField):
        moved = _moved_networks(field, similarity)
    elif not isinstance(field, VoxelField):
        raise InvalidInputError(f"a {type(field).__name__} cannot be moved: bake it first, with nerfnav bake")
    elif (axes := similarity.axes) is not None:
        scaled = _scaled(field, similarity.scale)
        moved = _turned_by_quarters(scaled, axes, replace(similarity, rotation=axes, scale=1.0))
    else:
        return (yield from resample_field(field, similarity))
    yield EditStep("moved", 1.0)
    return moved


def _moved_networks(field: NeuralField, similarity: Similarity) -> NeuralField:
    """Networks carry their pose and their unit: nothing is lost."""
    frame = Pose((similarity.rotation.float() @ field.frame.rotation), similarity(field.frame.position))
    config = replace(field.config, unit=similarity.scale * field.config.unit)
    return replace(field, box=similarity.box(field.box), frame=frame, config=config)


def _scaled(field: VoxelField, scale: float) -> VoxelField:
    """The field in a world that is `scale` times as large: p' = s p.

    What planners take for solid stays above their threshold [1/m], which falls no faster than densities do.
    """
    if scale == 1.0:
        return field
    raw, larger = field.values[..., 0], replace(field, box=Box(scale * field.box.lower, scale * field.box.upper))
    thinner = raws_of(DENSITY_SCALE / scale * torch.nn.functional.softplus(raw))
    thinner = torch.where(raw > raw_of(field.solid_density), thinner.clamp_min(least_solid_raw(larger)), thinner)
    if scale < 1:
        thinner = torch.maximum(thinner, raw)  # rounding must not empty a node that was not empty
    values = torch.cat([thinner[..., None], field.values[..., 1:]], -1)
    larger = replace(larger, values=values)
    if scale < 1 and larger.solid_density == field.solid_density:
        return larger  # nothing is less dense than before
    return preserve_occupancy(larger, field, Similarity(torch.eye(3).double(), torch.zeros(3).double(), 1 / scale))


def _turned_by_quarters(field: VoxelField, axes: Float[Tensor, "3 3"], similarity: Similarity) -> VoxelField:
    """The field with its axes exchanged: nodes stay nodes."""
    order = axes.abs().argmax(1).tolist()
    turned_over = [axis for axis, old in enumerate(order) if axes[axis, old] < 0]

    def exchanged(grid: Tensor) -> Tensor:
        return grid.permute(*order, *range(3, grid.ndim)).flip(turned_over).contiguous()

    return replace(
        field,
        box=similarity.box(field.box),
        values=exchanged(field.values),
        outside=None if field.outside is None else Surroundings(exchanged(field.outside.values)),
        evidence=None if field.evidence is None else exchanged(field.evidence),
    )
