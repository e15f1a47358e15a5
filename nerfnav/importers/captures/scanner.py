"""3D Scanner App's export of all data: frame_00000.json beside frame_00000.jpg.

The JSON has cameraPoseARFrame, T_world_camera row by row (16 numbers) in ARKit's world (metres, y up) with OpenGL axes,
and intrinsics, a 3 x 3 matrix row by row, in pixels of the photograph as it is stored. Its depth is depth_00000.png
[mm] or frame_00000.exr [m]; conf_00000.png tells how sure that is: 0, 1 or 2. Most frames have depth alone and no
photograph: those are passed over.
"""

from pathlib import Path

from PIL import Image

from nerfnav.importers.captures.views import CaptureError, Lens, View, Views, lidar_depth, read_json, rigid_pose

_FRAMES = "frame_*.json"


def is_scanner(folder: Path) -> bool:
    """Whether a folder is such an export."""
    return next(folder.glob(_FRAMES), None) is not None and next(folder.glob("frame_*.jpg"), None) is not None


def read_scanner(folder: Path) -> Views:
    """What an export says. Raises CaptureError where it says nothing that can be used."""
    pairs = [(file, file.with_suffix(".jpg")) for file in sorted(folder.glob(_FRAMES))]
    views = tuple(_view(file, photograph) for file, photograph in pairs if photograph.is_file())
    if not views:
        raise CaptureError(f"{folder} has frames of 3D Scanner App, but none of them has a photograph")
    return Views("3D Scanner App", views)


def _view(file: Path, photograph: Path) -> View:
    said = read_json(file)
    pose, matrix = said.get("cameraPoseARFrame"), said.get("intrinsics")
    if not (isinstance(pose, list) and isinstance(matrix, list) and len(pose) == 16 and len(matrix) == 9):
        raise CaptureError(f"{file} is not a frame of 3D Scanner App: it has no cameraPoseARFrame and intrinsics")
    try:
        fx, _, cx, _, fy, cy, *_ = (float(number) for number in matrix)
    except (TypeError, ValueError) as error:
        raise CaptureError(f"{file} has intrinsics that are no numbers") from error
    lens = Lens.measured(_size(photograph, (2 * cx, 2 * cy)), (fx, fy), (cx, cy))
    number = file.stem.removeprefix("frame_")
    sure = file.with_name(f"conf_{number}.png")
    depth = lidar_depth(file.with_name(f"depth_{number}.png"), sure) or lidar_depth(file.with_suffix(".exr"), sure, 1.0)
    rows = [pose[row : row + 4] for row in (0, 4, 8)]
    return View(photograph.name, photograph, lens, rigid_pose(rows, file.name), depth=depth)


def _size(photograph: Path, otherwise: tuple[float, float]) -> tuple[float, float]:
    """Width and height of a photograph [pixels]; of one that cannot be read, which is told later, a guess."""
    try:
        with Image.open(photograph) as image:
            return float(image.width), float(image.height)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return otherwise
