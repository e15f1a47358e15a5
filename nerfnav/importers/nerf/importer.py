"""Box of a NeRF: the part of space that holds what is solid."""

from pathlib import Path
from typing import cast

import numpy as np
import torch
from scipy import ndimage

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import NeuralField
from nerfnav.geometry import Box, node_positions, shape_for

_SEARCH_CELLS = 56
_SOLID = 10.0  # [1/unit]: density that makes a node part of the scene when the box is found
_LEAST_PART = 0.01  # connected parts with a smaller share of all solid nodes are floaters


def solid_box(field: NeuralField, file: Path) -> Box:
    """The part of the field's box that holds what is solid, and two cells around it."""
    spacing = float(field.box.size.max()) / _SEARCH_CELLS
    nodes = node_positions(field.box, shape_for(field.box, spacing))
    with torch.no_grad():
        solid = (field.density(nodes) > _SOLID / field.config.unit).numpy()
    labels, count = cast("tuple[np.ndarray, int]", ndimage.label(solid))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    kept = solid & (sizes[labels] >= _LEAST_PART * solid.sum())
    if not kept.any():
        raise InvalidInputError(f"{file} shows nothing solid within {field.box.describe()}: give the box that it fills")
    found = nodes[torch.from_numpy(kept)]
    lower, upper = found.amin(0) - 2 * spacing, found.amax(0) + 2 * spacing
    return Box(torch.maximum(lower, field.box.lower), torch.minimum(upper, field.box.upper))
