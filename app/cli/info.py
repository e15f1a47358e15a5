"""nerfnav info: what a field file holds, how good its shape is, and what it looks like."""

from dataclasses import asdict, dataclass
from pathlib import Path

from tyro.conf import Positional

from nerfnav.experiments import in_words
from nerfnav.field import load_field
from nerfnav_app.cli.field_picture import write_picture
from nerfnav_app.cli.info_geometry import freedom_of, geometry_of, grain, truth_of
from nerfnav_app.cli.terminal import show
from nerfnav_app.places.place import field_file


@dataclass(frozen=True)
class Arguments:
    """Tell what a field file holds."""

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    mesh: str | None = None
    """Name of a bundled scene, or path of a mesh (the one it was trained from, or one in its frame), to judge its shape
    by."""
    png: Path | None = None
    """File for a small picture of the field."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Print box, resolution, quality, origin and size; compare with a mesh and take a picture where asked to."""
    name = arguments.field
    path = field_file(name)
    field = load_field(path)
    summary = {
        "box": {"lower": field.box.lower.tolist(), "upper": field.box.upper.tolist()},
        **grain(field),
        **asdict(field.info),
        "file_bytes": path.stat().st_size,
    }
    for name in ("surface_taken_for_free", "free_taken_for_free", "unproven_share"):
        del summary[name]  # told together, below
    freedom = freedom_of(field, path)
    summary["geometry"] = asdict(freedom)
    if arguments.mesh is not None:
        summary["geometry"] |= asdict(geometry_of(field, truth_of(arguments.mesh, field, path)))
    summary["in_words"] = in_words(freedom)
    if arguments.png is not None:
        summary["png"] = str(write_picture(field, arguments.png))
    show(str(path), summary, arguments.json)
