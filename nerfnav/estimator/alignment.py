"""Many camera poses at once, each turned and moved until the field looks like a small picture.

    r(T) = C(T) - I, with the pixels of both averaged over areas;  T <- T (+) d,  (J'J + lambda D) d = -J'r

(Levenberg, Marquardt). The derivative J is by differences over half a pixel's motion: as blurred as the
pictures themselves, so that details finer than a pixel do not mislead it. A pose's tangent is (dp, dtheta): p + dp,
R Exp(dtheta).
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.field.field import Field
from nerfnav.field.render import FastRenderer, render_rays
from nerfnav.geometry import so3
from nerfnav.geometry.camera import Camera, Pose

_RAYS_AT_ONCE = 1 << 17
_TYPICAL_DEPTH = 0.5
"""How far off the things are that a picture shows [share of the box's longest edge]."""


@dataclass(frozen=True)
class AlignConfig:
    """How poses are improved."""

    iterations: int = 7
    """Steps of each pose."""
    damping: float = 1e-2
    """First lambda, relative to the diagonal of J'J."""
    robust: float = 0.15
    """Colour difference beyond which a pixel pulls less and less (Huber) [1 = full scale]."""


@dataclass(frozen=True)
class SmallPicture:
    """A picture with few pixels, each the mean of an area, and how to render the like of it."""

    field: Field
    """What the picture should look like."""
    camera: Camera
    """Intrinsics of the small picture."""
    colors: Float[Tensor, "p 3"]
    """Its pixels, row by row, in [0, 1]."""
    oversampling: int = 2
    """Rays along each side of a pixel."""

    @classmethod
    def of(cls, image: UInt8[Tensor, "height width 3"], field: Field, camera: Camera, side: int) -> "SmallPicture":
        """A picture of `camera`, reduced until its longer side has about `side` pixels."""
        small = camera.scaled(min(1.0, side / max(camera.width, camera.height)))
        planes = image.permute(2, 0, 1)[None].float() / 255
        reduced = torch.nn.functional.interpolate(planes, (small.height, small.width), mode="area")
        return cls(field, small, reduced[0].permute(1, 2, 0).reshape(-1, 3))

    @torch.no_grad()
    def rendered(self, poses: Pose) -> Float[Tensor, "n p 3"]:
        """What the field shows from poses T_world_camera of batch shape (n,), in pictures of the same kind."""
        fine = self.camera.scaled(self.oversampling)
        in_camera = fine.directions(fine.pixels())
        directions = (in_camera @ poses.rotation.transpose(-1, -2)).reshape(-1, 3)
        origins = poses.position[:, None].expand(-1, len(in_camera), 3).reshape(-1, 3)
        parts = [
            self.field.render_rays(origin, direction).color
            if isinstance(self.field, FastRenderer)
            else render_rays(self.field, origin, direction).color
            for origin, direction in zip(
                origins.split(_RAYS_AT_ONCE), directions.split(_RAYS_AT_ONCE), strict=True
            )
        ]
        planes = torch.cat(parts).reshape(-1, fine.height, fine.width, 3).permute(0, 3, 1, 2)
        averaged = torch.nn.functional.avg_pool2d(planes, self.oversampling)
        return averaged.permute(0, 2, 3, 1).reshape(len(poses.position), -1, 3)

    def residual(self, poses: Pose) -> Float[Tensor, "n m"]:
        """What the field shows less what the picture shows; all channels of all pixels."""
        return (self.rendered(poses) - self.colors).flatten(1)

    def jacobian(self, poses: Pose, residual: Float[Tensor, "n m"]) -> Float[Tensor, "n m 6"]:
        """Derivative of the residual by position and attitude, by differences over half a pixel."""
        angle = 0.5 / self.camera.fx
        reach = angle * _TYPICAL_DEPTH * float(self.field.box.size.max())
        steps = torch.diag(torch.tensor([reach] * 3 + [angle] * 3))
        count = len(poses.position)
        spread = Pose(poses.rotation[:, None].expand(-1, 6, 3, 3), poses.position[:, None].expand(-1, 6, 3))
        moved = self.residual(flattened(retract(spread, steps.expand(count, 6, 6)))).reshape(count, 6, -1)
        return ((moved - residual[:, None]) / steps.diagonal()[:, None]).transpose(1, 2)


def retract(poses: Pose, tangent: Float[Tensor, "*batch 6"]) -> Pose:
    """Poses (+) tangent."""
    return Pose(so3.retract(poses.rotation, tangent[..., 3:]), poses.position + tangent[..., :3])


def flattened(poses: Pose) -> Pose:
    """The same poses with one batch dimension."""
    return Pose(poses.rotation.reshape(-1, 3, 3), poses.position.reshape(-1, 3))


def robust_cost(residual: Float[Tensor, "n m"], bound: float) -> Float[Tensor, " n"]:
    """Mean Huber loss of each row, half the mean square where differences are below `bound`."""
    size = residual.abs()
    return torch.where(size <= bound, 0.5 * size.square(), bound * (size - 0.5 * bound)).mean(-1)


def align(picture: SmallPicture, poses: Pose, config: AlignConfig) -> tuple[Pose, Float[Tensor, " n"]]:
    """Poses (n,) after some steps of Levenberg and Marquardt each, and their robust costs, none above its first."""
    residual = picture.residual(poses)
    cost = robust_cost(residual, config.robust)
    damping = torch.full_like(cost, config.damping)
    for _ in range(config.iterations):
        jacobian = picture.jacobian(poses, residual)
        weight = (config.robust / residual.abs().clamp_min(1e-9)).clamp_max(1)
        weighted = (jacobian * weight[..., None]).transpose(1, 2)
        curvature, slope = weighted @ jacobian, (weighted @ residual[..., None])[..., 0]
        scale = curvature.diagonal(dim1=-2, dim2=-1).clamp_min(1e-6)
        step = -torch.linalg.solve(curvature + torch.diag_embed(damping[:, None] * scale), slope)
        tried = retract(poses, step)
        tried_residual = picture.residual(tried)
        tried_cost = robust_cost(tried_residual, config.robust)
        better = tried_cost < cost
        poses = Pose(
            torch.where(better[:, None, None], tried.rotation, poses.rotation),
            torch.where(better[:, None], tried.position, poses.position),
        )
        residual = torch.where(better[:, None], tried_residual, residual)
        cost = torch.where(better, tried_cost, cost)
        damping = torch.where(better, 0.3 * damping, 4 * damping).clamp(1e-6, 1e6)
    return poses, cost
