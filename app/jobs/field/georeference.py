"""Report of a field that was put right: its files, and what `place --json` prints."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from nerfnav.experiments import freedom_alone, in_words
from nerfnav.field import StoredField, VoxelField
from nerfnav.importers import Splats, save_splats, splats_beside
from nerfnav.world import Scene
from nerfnav_app.jobs.events import JobResult
from nerfnav_app.jobs.trained_field import stored


@dataclass(frozen=True, eq=False)
class Placed:
    """A field that was put right, and what is stored beside it."""

    field: StoredField
    splats: Splats | None
    truth: Scene | None
    told: tuple[str, ...]
    """What has changed, in words."""


def save(made: Placed, out: Path) -> JobResult:
    """Store it in `out` and beside that, and tell its numbers."""
    size, files = stored(made.field, made.truth, out)
    if made.splats is not None:
        files = (*files, save_splats(made.splats, splats_beside(out)))
    return JobResult({**_numbers(made), "file_bytes": size}, files)


def _numbers(made: Placed) -> dict[str, Any]:
    field = made.field
    voxel = float(field.spacing.max()) if isinstance(field, VoxelField) else field.step
    freedom = freedom_alone(field, voxel)
    return {
        "box": {"lower": field.box.lower.tolist(), "upper": field.box.upper.tolist()},
        "voxel_m": voxel,
        "changed": list(made.told),
        "guesses": list(field.info.guesses),
        "geometry": asdict(freedom),
        "in_words": in_words(freedom),
    }
