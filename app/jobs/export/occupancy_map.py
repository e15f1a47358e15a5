"""Occupancy map job (`nerfnav map`): write which voxels of a field are free, solid or unproven, for other programs."""

import io
import zipfile
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path

from nerfnav.core.errors import require_positive
from nerfnav.export import map_files
from nerfnav.export.occupancy_map import check_ending
from nerfnav.field import Occupancy, OccupancyGrid, StoredField, compute_occupancy_grid
from nerfnav.planner import threshold_of
from nerfnav_app.jobs.events import FileMade, JobEvents, JobResult, Progress
from nerfnav_app.storage.output_files import prepare_file, write_bytes


@dataclass(frozen=True)
class MapRequest:
    """Request of a map: file, height and voxel. The command line reads it as it is."""

    out: Path
    """File to write: .npz, .glb, .pgm or .yaml."""
    height: float | None = None
    """Height of the layer of a ROS map [m] (default: the middle of the place)."""
    voxel: float | None = None
    """Size of a voxel [m] (default: that of the field)."""

    def __post_init__(self) -> None:
        """Raise NerfnavError for an unknown ending and for numbers that no map can have."""
        check_ending(self.out.suffix, self.height)
        require_positive(voxel=self.voxel)


def run(field: StoredField, request: MapRequest) -> JobEvents:
    """Write the map and what belongs to it, and return its numbers.

    Raises NerfnavError where the field has no voxels or the files cannot be written.
    """
    out = prepare_file(request.out)
    grid, contents = yield from _made(field, request)
    files = tuple(write_bytes(out.with_name(name), content) for name, content in contents.items())
    return JobResult(_numbers(grid) | {"files": [str(path) for path in files]}, files)


def download(field: StoredField, request: MapRequest) -> JobEvents:
    """Yield the map as one file instead of writing it: a zip where it has several files. Raises as `run` does."""
    grid, contents = yield from _made(field, request)
    (name, content), *others = contents.items()
    if others:
        name, content = f"{request.out.stem}.zip", _zipped(contents)
    yield FileMade(name, content)
    return JobResult(_numbers(grid))


def _made(
    field: StoredField, request: MapRequest
) -> Generator[Progress, bool | None, tuple[OccupancyGrid, dict[str, bytes]]]:
    """The voxels of a map, and its files by their names."""
    yield Progress("looking at all voxels", 0.1)
    grid = compute_occupancy_grid(field, threshold_of(field), request.voxel)
    yield Progress("writing the map", 0.7)
    return grid, map_files(grid, request.out.suffix, request.out.stem, request.height)


def _zipped(contents: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in contents.items():
            packed.writestr(name, content)
    return stream.getvalue()


def _numbers(grid: OccupancyGrid) -> dict[str, object]:
    return {
        "shape": list(grid.state.shape),
        "lower": grid.lower.tolist(),
        "voxel_m": grid.voxel,
        **{f"{state.name.lower()}_share": grid.share(state) for state in Occupancy},
    }
