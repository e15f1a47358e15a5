"""Volume rendering in torch: the reference path, on any device, differentiable twice.

    alpha_i = 1 - exp(-rho_i step),  T_i = prod_{j<i} (1 - alpha_j),  C = sum_i T_i alpha_i c_i + T_end background

(Max, "Optical models for direct volume rendering", 1995; Mildenhall et al., "NeRF", 2020, Eq. 3.)
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.field.core.protocol import Field, RaySamples
from nerfnav.field.render.surroundings import Backdrop
from nerfnav.geometry import Camera, Pose

_RAYS_AT_ONCE = 8192


@dataclass(frozen=True)
class Rendering:
    """Colour, opacity and depth along rays."""

    color: Float[Tensor, "*batch 3"]
    """In [0, 1]."""
    opacity: Float[Tensor, "*batch"]
    """Share of the light that is stopped inside the field, 1 - T_end."""
    depth: Float[Tensor, "*batch"]
    """Mean distance of what stops the light [m], weighted by T alpha; 0 where nothing does."""

    @property
    def image(self) -> UInt8[Tensor, "*batch 3"]:
        """The colours as a photograph has them, 0 to 255."""
        return (255 * self.color.clamp(0, 1)).round().to(torch.uint8)


@runtime_checkable
class FastRenderer(Protocol):
    """A field with a renderer of its own, faster than the reference and without gradients."""

    def render_rays(self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]) -> Rendering:
        """The same colours as `render_rays`, to 1e-3."""
        ...


@runtime_checkable
class HasBackdrop(Protocol):
    """A field with surroundings, seen by what light leaves its box."""

    def backdrop(self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]) -> Backdrop | None:
        """Render what lies behind the box, differentiable; None where that is the background."""
        ...


def render_rays(
    field: Field,
    origins: Float[Tensor, "n 3"],
    directions: Float[Tensor, "n 3"],
    samples: RaySamples | None = None,
) -> Rendering:
    """Render rays (origins [m], unit directions), differentiable in origins and directions.

    `samples` are the field's own by default; gradients do not flow into the distances of the samples.
    """
    samples = field.samples(origins.detach(), directions.detach()) if samples is None else samples
    points = origins[:, None] + samples.distances[..., None] * directions[:, None]
    density = torch.where(samples.mask, field.density(points), torch.zeros_like(samples.distances))
    color = field.radiance(points, directions[:, None].expand_as(points))
    return before_backdrop(field, (origins, directions), density, color, samples)


def before_backdrop(
    field: Field,
    rays: tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]],
    density: Float[Tensor, "n s"],
    color: Float[Tensor, "n s 3"],
    samples: RaySamples,
) -> Rendering:
    """Join the samples of rays (origins, directions), before what the field has behind its box."""
    behind = field.backdrop(*rays) if isinstance(field, HasBackdrop) else None
    if behind is None:
        return composite(density, color, samples, field.background)
    return over(composite(density, color, samples, torch.zeros_like(field.background)), behind, field.background)


def composite(
    density: Float[Tensor, "n s"],
    color: Float[Tensor, "n s 3"],
    samples: RaySamples,
    background: Float[Tensor, "3"],
) -> Rendering:
    """Join the densities [1/m] and colours of the samples of each ray; masked samples must have density 0."""
    optical = density * samples.step
    through = torch.exp(-torch.cumsum(optical, -1))
    before = torch.cat([torch.ones_like(through[:, :1]), through[:, :-1]], -1)
    weights = before - through
    remaining = through[:, -1]
    opacity = 1 - remaining
    mixed = (weights[..., None] * color).sum(-2) + remaining[..., None] * background
    depth = (weights * samples.distances).sum(-1) / opacity.clamp_min(1e-6)
    return Rendering(mixed, opacity, depth)


def over(front: Rendering, behind: Backdrop, background: Float[Tensor, "3"]) -> Rendering:
    """Composite the box, rendered before black, over its surroundings and the background."""
    left = 1 - front.opacity
    lit = behind.color + (1 - behind.opacity)[..., None] * background
    opacity = 1 - left * (1 - behind.opacity)
    depth = (front.opacity * front.depth + left * behind.opacity * behind.depth) / opacity.clamp_min(1e-6)
    return Rendering(front.color + left[..., None] * lit, opacity, depth)


@torch.no_grad()
def render_image(field: Field, camera: Camera, pose: Pose) -> Rendering:
    """The picture (height, width) that a camera at `pose` = T_world_camera takes of the field, no gradients."""
    origins, directions = camera.rays(pose)
    parts = [
        field.render_rays(*rays) if isinstance(field, FastRenderer) else render_rays(field, *rays)
        for rays in zip(origins.split(_RAYS_AT_ONCE), directions.split(_RAYS_AT_ONCE), strict=True)
    ]
    size = (camera.height, camera.width)
    return Rendering(
        torch.cat([part.color for part in parts]).reshape(*size, 3),
        torch.cat([part.opacity for part in parts]).reshape(size),
        torch.cat([part.depth for part in parts]).reshape(size),
    )
