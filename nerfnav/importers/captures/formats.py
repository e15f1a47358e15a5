"""Which kind of capture a folder or file is."""

from pathlib import Path

from nerfnav.importers.captures import colmap, transforms
from nerfnav.importers.captures.views import CaptureError, Views


def is_capture(folder: Path) -> bool:
    """Whether a folder holds the files of a capture of any kind."""
    names = ("transforms.json", *(f"transforms_{split}.json" for split in transforms.SPLITS))
    return any((folder / name).is_file() for name in names) or colmap.model_folder(folder) is not None


def read_views(folder: Path) -> Views:
    """What the files of a capture say: a folder, or a transforms.json itself.

    Raises CaptureError where it is no capture, or one that cannot be used.
    """
    if folder.is_file():
        return transforms.read_transforms(folder)
    if (folder / "transforms.json").is_file():
        return transforms.read_transforms(folder / "transforms.json")
    if any((folder / f"transforms_{split}.json").is_file() for split in transforms.SPLITS):
        return transforms.read_blender(folder)
    if colmap.model_folder(folder) is not None:
        return colmap.read_colmap(folder)
    raise CaptureError(
        f"{folder} is no capture: there is no transforms.json (nerfstudio, instant-ngp), no transforms_train.json "
        f"(Blender), and no cameras and images, .bin or .txt, in {' or '.join(colmap.MODEL_FOLDERS)} (COLMAP)"
    )
