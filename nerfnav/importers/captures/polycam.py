"""Polycam's raw export ("keyframes"): a JSON file for each camera, by the stems of its photographs.

keyframes/cameras/STEM.json has fx, fy, cx, cy, width, height [pixels] and t_00 to t_23, the upper rows of
T_world_camera in ARKit's world (metres, y up) with OpenGL axes; keyframes/images/STEM.jpg is the photograph,
keyframes/depth/STEM.png its depth [mm], keyframes/confidence/STEM.png how sure that is: 0, 127 or 255. Where the app
has refined the poses, corrected_cameras and corrected_images stand beside these and are used; there are no corrected
depths, but those of the bent lens lie within a pixel of theirs, which are large.
"""

from pathlib import Path

from nerfnav.importers.captures.transforms import image_path
from nerfnav.importers.captures.views import CaptureError, Lens, View, Views, lidar_depth, read_json, rigid_pose

_KEYFRAMES = "keyframes"
_PAIRS = (("corrected_cameras", "corrected_images"), ("cameras", "images"))


def is_polycam(folder: Path) -> bool:
    """Whether a folder is such an export, or its keyframes."""
    return _parts(folder) is not None


def read_polycam(folder: Path) -> Views:
    """What an export says. Raises CaptureError where it is cut off or says nothing that can be used."""
    parts = _parts(folder)
    if parts is None:
        raise CaptureError(f"{folder} has no {_KEYFRAMES} of Polycam")
    cameras, images = parts
    views = tuple(_view(file, images) for file in sorted(cameras.glob("*.json")))
    return Views("Polycam", views)


def _parts(folder: Path) -> tuple[Path, Path] | None:
    """The folders of cameras and of photographs."""
    for root in (folder / _KEYFRAMES, folder):
        for cameras, images in _PAIRS:
            if (root / images).is_dir() and next((root / cameras).glob("*.json"), None) is not None:
                return root / cameras, root / images
    return None


def _view(file: Path, images: Path) -> View:
    said = read_json(file)
    try:
        rows = [[float(said[f"t_{row}{column}"]) for column in range(4)] for row in range(3)]
        size = float(said["width"]), float(said["height"])
        lens = Lens.measured(
            size, (float(said["fx"]), float(said["fy"])), (float(said["cx"]), float(said["cy"]))
        )
    except (KeyError, TypeError, ValueError) as error:
        raise CaptureError(f"{file} is not a camera of Polycam: it lacks or garbles {error}") from error
    depth, sure = (images.parent / part / f"{file.stem}.png" for part in ("depth", "confidence"))
    pose = rigid_pose(rows, file.name)
    return View(file.stem, image_path(images, file.stem), lens, pose, depth=lidar_depth(depth, sure))
