"""Query for the density of the field at one height."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch

from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.session import Session

_CELLS = 240
_DENSITY = 20.0  # [1/m] at which a slice is at its strongest


@dataclass(frozen=True)
class DensitySliceQuery(Query[np.ndarray]):
    """Query for a level slice of the density, from above: (along x, along y, 4), sRGB bytes and opacity."""

    reads_field: ClassVar[bool] = True
    share: float
    """Height as a share of the box, 0 to 1."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["DensitySliceQuery"]:
        """Ask at the height of the view settings."""
        share = session.view_settings.slice
        if share is not None:
            yield cls(share)

    def answer(self, resources: Resources) -> np.ndarray:
        """Compute the density at one height; denser is brighter and less transparent."""
        field = resources.place.field
        box, size = field.box, field.box.size
        cells = [max(2, round(_CELLS * float(size[axis] / size[:2].max()))) for axis in (0, 1)]
        x, y = (box.lower[axis] + size[axis] * (torch.arange(cells[axis]) + 0.5) / cells[axis] for axis in (0, 1))
        points = torch.cartesian_prod(x, y, box.lower[2:] + self.share * size[2:])
        dense = (1 - torch.exp(-field.density(points).reshape(cells) / _DENSITY)).numpy()
        # from a faint blue through red to yellow, as heat maps go
        color = np.stack([dense**0.5, dense**1.5, 0.5 * (1 - dense), 0.25 + 0.75 * dense], -1)
        return np.round(255 * color).astype(np.uint8)
