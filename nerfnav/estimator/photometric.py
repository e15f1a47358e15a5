"""The photometric term of the filter (first term of paper Eq. 6): is this what the field shows from here?

    r_i(x) = C_i(T) - I_i,   J_photo(x) = sum over inlier pixels i of |r_i|^2 / (k s^2)

with C_i the colour that the field sends into pixel i at the camera pose T = T_world_body T_body_camera, I_i
the colour in the picture, s the standard deviation of the noise on one colour channel, and k the number of pixels
that err alike: S = k s^2 I.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from nerfnav.field.field import Field, RaySamples
from nerfnav.field.render import composite
from nerfnav.geometry.camera import Camera, Pose
from nerfnav.robots.state import RigidState

_DEVIATION_PER_MAD = 1.4826
"""Standard deviation of a Gaussian whose median absolute deviation is 1."""


@dataclass(frozen=True)
class ColorNoise:
    """How far a field's colours are from a picture's when the pose is right."""

    std: float = 0.05
    """s, of one colour channel [1 = full scale]; measured on held-out views of each field (authors' code: 1)."""
    alike: float = 50.0
    """k, pixels that err alike (authors' code: 1). A field's errors are no independent noise: a stone's edge that
    is off by half a voxel shifts all pixels along it. Measured on trained Stonehenge: with 256 pixels the pose at the
    minimum is 3 mm and 0.2 degrees off, where independent pixels would promise 0.5 mm and 0.04 degrees; with 50 the
    mean NEES of the pose is 6.1 where 6 is honest."""
    outlier_deviations: float = 3.0
    """Pixels this many robust deviations above the median difference are dropped (authors' later code: none)."""


@dataclass(frozen=True)
class Observation:
    """Some pixels of a picture, and what is needed to predict them."""

    field: Field
    """What the picture should look like."""
    camera: Camera
    """What took the picture."""
    mount: Pose
    """T_body_camera."""
    pixels: Int[Tensor, "m 2"]
    """(u, v) of the pixels that are compared."""
    colors: Float[Tensor, "m 3"]
    """Their colours in [0, 1]."""

    @classmethod
    def of(
        cls,
        image: UInt8[Tensor, "height width 3"],
        pixels: Int[Tensor, "m 2"],
        view: tuple[Field, Camera, Pose],
    ) -> "Observation":
        """The given pixels of a picture; `view` is (field, camera, mount)."""
        return cls(*view, pixels, image[pixels[:, 1], pixels[:, 0]].float() / 255)

    def rays(self, state: RigidState) -> tuple[Float[Tensor, "m 3"], Float[Tensor, "m 3"]]:
        """Origins [m] and unit directions in the world, differentiable in the state's pose."""
        return self.camera.rays(state.pose.compose(self.mount), self.pixels)

    @torch.no_grad()
    def samples(self, state: RigidState) -> RaySamples:
        """Where the field wants the pixels' rays sampled."""
        return self.field.samples(*self.rays(state))

    def residual(self, state: RigidState, samples: RaySamples | None = None) -> Float[Tensor, "m 3"]:
        """r_i: what the field shows less what the picture shows, differentiable twice in the state's pose.

        `samples` are the field's own for this state by default. The same as `render_rays`, but the field is not
        asked about the padding, which is most of the table.
        """
        samples = self.samples(state) if samples is None else samples
        origins, directions = self.rays(state)
        ray, _ = place = samples.mask.nonzero(as_tuple=True)
        points = origins[ray] + samples.distances[place][:, None] * directions[ray]
        density = torch.zeros_like(samples.distances).index_put(place, self.field.density(points))
        color = torch.zeros_like(samples.distances[..., None].expand(-1, -1, 3))
        color = color.index_put(place, self.field.radiance(points, directions[ray]))
        return composite(density, color, samples, self.field.background).color - self.colors


def difference(residual: Float[Tensor, "m 3"]) -> Float[Tensor, " m"]:
    """Colour difference of each pixel, root mean square over the channels, in [0, 1]."""
    return residual.square().mean(-1).sqrt()


@torch.no_grad()
def inliers(residual: Float[Tensor, "m 3"], noise: ColorNoise) -> Bool[Tensor, " m"]:
    """Which pixels to believe: those less than so many robust deviations above the median difference.

    A pixel within as many standard deviations of the noise is always believed, however alike the others are.
    """
    size = difference(residual)
    median = size.median()
    spread = _DEVIATION_PER_MAD * (size - median).abs().median()
    plain = torch.full_like(median, noise.outlier_deviations * noise.std)
    return size <= torch.maximum(median + noise.outlier_deviations * spread, plain)


def photometric_cost(
    residual: Float[Tensor, "m 3"], believed: Bool[Tensor, " m"], noise: ColorNoise
) -> Float[Tensor, ""]:
    """J_photo; pixels that are not believed count nothing and pull nowhere."""
    return (residual.square().sum(-1) * believed).sum() / (noise.alike * noise.std**2)
