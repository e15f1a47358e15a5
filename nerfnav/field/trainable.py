"""What training asks of its photographs and of the machine, checked before it begins."""

from nerfnav import memory
from nerfnav.errors import InvalidInputError
from nerfnav.field.trained_grid import training_bytes
from nerfnav.geometry import Box, PosedImages

_LEAST_IMAGES = 2
_ORTHONORMAL = 1e-2  # how far a rotation times its transpose may be from the identity


def require_trainable(photographs: PosedImages, box: Box) -> None:
    """Raise InvalidInputError, in one sentence, for photographs that no field can be learned from."""
    count, rotation, position = len(photographs), photographs.poses.rotation, photographs.poses.position
    if count < _LEAST_IMAGES:
        raise InvalidInputError(
            f"{count or 'no'} image{'s' if count != 1 else ''} cannot show where things are: at least {_LEAST_IMAGES}, "
            "better a hundred, from different places are needed"
        )
    if not (box.size > 0).all() or not box.size.isfinite().all():
        raise InvalidInputError(f"the box {box.describe()} is empty: its upper corner must lie above its lower one")
    finite = rotation.isfinite().flatten(1).all(1) & position.isfinite().all(1)
    if not finite.all():
        raise InvalidInputError(f"the pose of image {int((~finite).nonzero()[0])} is not finite: leave that image out")
    gram = (rotation @ rotation.transpose(-1, -2) - rotation.new_ones(3).diag()).abs().flatten(1).amax(1)
    turned = (gram > _ORTHONORMAL) | (rotation.det() < 0)
    if turned.any():
        raise InvalidInputError(f"the pose of image {int(turned.nonzero()[0])} is no rotation: leave that image out")


def require_memory(shape: tuple[int, int, int], outside: int, workers: int) -> None:
    """Raise InvalidInputError where the machine's free memory cannot hold the training of grids of these sizes."""
    nx, ny, nz = shape
    needed = training_bytes(nx * ny * nz, workers) + training_bytes(outside**3, workers)
    memory.require_memory(needed, f"training {nx} x {ny} x {nz} nodes", "choose a larger voxel")
