"""Picture of a field for people, as a file."""

from pathlib import Path

import torch

from nerfnav.field import StoredField, render_image
from nerfnav.geometry import Camera, look_at, picture_file
from nerfnav_app.storage.output_files import prepare_file, write_bytes

_WIDTH, _HEIGHT, _FOV_DEG = 480, 360, 70.0
_STANDPOINT = (0.62, -0.68, 0.42)
"""Where the picture is taken from: off the box's middle, in longest edges of it, high enough to see over things."""


def write_picture(field: StoredField, out: Path) -> Path:
    """What the field looks like from above one of its corners."""
    path = prepare_file(out)
    eye = field.box.center + torch.tensor(_STANDPOINT) * field.box.size.max()
    aim = field.box.center - 0.15 * field.box.size * torch.tensor([0.0, 0.0, 1.0])
    seen = render_image(field, Camera.from_fov(_WIDTH, _HEIGHT, _FOV_DEG), look_at(eye, aim))
    return write_bytes(path, picture_file(seen.image.numpy()))
