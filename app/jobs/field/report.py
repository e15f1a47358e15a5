"""Numbers of a field that was made of somebody else's file."""

from dataclasses import asdict
from typing import Any

import numpy as np

from nerfnav.experiments import freedom_alone, in_words
from nerfnav.field import StoredField, VoxelField
from nerfnav.importers import (
    Placement,
)
from nerfnav.importers.core.placement import Vector


def numbers_of(made: StoredField) -> dict[str, Any]:
    nodes = {"voxels": int(np.prod(made.shape))} if isinstance(made, VoxelField) else {}
    corners = {"lower": made.box.lower.tolist(), "upper": made.box.upper.tolist()}
    freedom = freedom_alone(made, float(made.spacing.max()) if isinstance(made, VoxelField) else made.step)
    told = {"geometry": asdict(freedom), "in_words": in_words(freedom)}
    return {"box": corners, **nodes, "baked_psnr_db": made.info.baked_psnr_db, **told}


def placed_by(placement: Placement, up: Vector) -> dict[str, Any]:
    """Up and scale as they were taken, and which of them nobody gave."""
    given = {"up": placement.up, "scale": placement.meters_per_unit, "box": placement.box}
    return {
        "up": list(placement.up or up),
        "meters_per_unit": placement.meters_per_unit or 1.0,
        "guessed": [name for name, value in given.items() if value is None],
    }
