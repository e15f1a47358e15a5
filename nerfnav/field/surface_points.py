"""Points on the surfaces of a field, for fitting planes and for telling which side of them things stand on."""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.evidence import SOLID_DENSITY
from nerfnav.field.field import Field
from nerfnav.field.meshing import sample_density
from nerfnav.geometry import node_positions, shape_for, spacing_of


def surface_points(field: Field, spacing: float, towards: tuple[float, float, float]) -> Float[Tensor, "n 3"]:
    """Where what is solid ends in the direction of the axis that is nearest to `towards`, in steps of `spacing` [m]."""
    dense = torch.from_numpy(sample_density(field, spacing)) > SOLID_DENSITY
    axis = int(torch.tensor(towards).abs().argmax())
    sign = 1 if towards[axis] > 0 else -1
    shape = shape_for(field.box, spacing)
    step = torch.zeros(3)
    step[axis] = 0.5 * sign * float(spacing_of(field.box, shape)[axis])
    count = shape[axis] - 1
    inner, beyond = (0, 1) if sign > 0 else (1, 0)
    top = dense.narrow(axis, inner, count) & ~dense.narrow(axis, beyond, count)
    return node_positions(field.box, shape).narrow(axis, inner, count)[top] + step
