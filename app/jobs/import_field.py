"""Import: make a field of a NeRF's checkpoint that others have trained or Gaussian splats."""

from pathlib import Path

from nerfnav.errors import InvalidInputError
from nerfnav.importers import (
    SourceKind,
    source_kind,
    wrong_kind,
)
from nerfnav_app.jobs.events import JobEvents
from nerfnav_app.jobs.import_nerf import import_nerf
from nerfnav_app.jobs.import_request import ImportRequest
from nerfnav_app.jobs.import_splats import import_splats
from nerfnav_app.storage.output_files import prepare_file


def imports(source: Path) -> bool:
    """Whether a file or folder is of a kind that is imported, not trained from."""
    return source_kind(source).command == "import"


def run(request: ImportRequest) -> JobEvents:
    """Yield progress, and return the numbers of the stored field.

    Raises InvalidInputError where the source is nothing of these kinds, or the file cannot be written.
    """
    if not request.source.exists():
        raise InvalidInputError(f"there is no file or folder {request.source}")
    kind = source_kind(request.source)
    if kind not in (SourceKind.NERF, SourceKind.SPLATS):
        raise wrong_kind(request.source, kind, "a trained NeRF or a file of Gaussian splats")
    out = prepare_file(request.out)
    return import_nerf(request, out) if kind is SourceKind.NERF else import_splats(request, out)
