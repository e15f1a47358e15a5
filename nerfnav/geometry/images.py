"""Photographs with known poses: what a capture yields and what a field is trained from."""

from dataclasses import dataclass

from jaxtyping import UInt8
from torch import Tensor

from nerfnav.geometry.camera import Camera, Pose


@dataclass(frozen=True)
class PosedImages:
    """Images of one camera, each with the pose that it was taken from."""

    images: UInt8[Tensor, "n height width 3"]
    """sRGB colours, 0 to 255."""
    camera: Camera
    """Intrinsics, the same for all images."""
    poses: Pose
    """T_world_camera of each image; batch shape (n,)."""

    def __len__(self) -> int:
        """How many images there are."""
        return self.images.shape[0]

    def subset(self, index: "list[int] | slice") -> "PosedImages":
        """The images at `index`, with their poses."""
        return PosedImages(self.images[index], self.camera, self.poses[index])
