"""nerfnav info: what a field file holds."""

from dataclasses import asdict, dataclass
from pathlib import Path

from tyro.conf import Positional

import scenes
from app.commands.screen import show
from nerfnav.field.checkpoint import load_field


@dataclass(frozen=True)
class Arguments:
    """Tell what a field file holds."""

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Print box, resolution, quality, origin and size."""
    name = arguments.field
    path = scenes.trained_path(name) if name in scenes.names() else Path(name)
    field = load_field(path)
    summary = {
        "box": {"lower": field.box.lower.tolist(), "upper": field.box.upper.tolist()},
        "resolution": list(field.shape),
        "voxel_m": field.spacing.max().item(),
        **asdict(field.info),
        "file_bytes": path.stat().st_size,
    }
    show(str(path), summary, arguments.json)
