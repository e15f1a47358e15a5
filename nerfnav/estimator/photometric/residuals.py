"""Photometric residuals: the field's colours at a pose less the picture's (first term of paper Eq. 6).

    r_i(x) = C_i(T) - I_i,   J_photo(x) = sum over inlier pixels i of |r_i|^2 / (k s^2)

with C_i the colour that the field sends into pixel i at the camera pose T = T_world_body T_body_camera, I_i
the colour in the picture, s the standard deviation of the noise on one colour channel, and k the number of pixels
that err alike: S = k s^2 I.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np
import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from nerfnav.core.jit import array_of, threads
from nerfnav.estimator.photometric.kernels.descent import slopes
from nerfnav.estimator.photometric.kernels.probe import probe
from nerfnav.field import FastRenderer, Field, GridField, RaySamples, colors_and_jacobian, get_ray_grid, render_rays
from nerfnav.field.render.volume_rendering import before_backdrop
from nerfnav.geometry import Camera, Pose, so3
from nerfnav.robots import RigidState

THREADS = 1
"""That views of the field are made on, wherever they are compared with pictures: beside any other program, two wait for
each other longer than they save."""
_RAYS_AT_ONCE = 1 << 17
_TABLED = 1 << 18
"""Pixels of the largest camera whose directions are kept: a table of more would not fit the cache."""
_DEVIATION_PER_MAD = 1.4826
"""Standard deviation of a Gaussian whose median absolute deviation is 1."""

_CORE = 3.0
"""Robust deviations within which errors are no outliers."""


@dataclass(frozen=True)
class ColorNoise:
    """Noise of colours: differences of field and picture at the right pose."""

    std: float = 0.05
    """s, of one colour channel [1 = full scale]; measured on held-out views of each field (authors' code: 1)."""
    alike: float = 50.0
    """k, pixels that err alike (authors' code: 1). A field's errors are no independent noise: a stone's edge that
    is off by half a voxel shifts all pixels along it. Measured on trained Stonehenge: with 256 pixels the pose at the
    minimum is 3 mm and 0.2 degrees off, where independent pixels would promise 0.5 mm and 0.04 degrees; with 50 the
    mean NEES of the pose is 6.1 where 6 is honest."""
    per_patch: float = 1.0
    """To the fast filter, any number of pixels of a patch are worth this many independent ones (see `count_patches`),
    so that k = 1 + m / (per_patch patches) for m compared pixels."""
    few_patches: float = 25.0
    """Fewer patches than this are worth less each, by the square of their number: where little shows, it is what is
    near, errors of the field are large in the picture, and hardly any patch speaks against another's."""
    outlier_deviations: float = 3.0
    """Pixels this many robust deviations above the median difference are dropped (authors' later code: none)."""

    def measured(self, std: float | None) -> "ColorNoise":
        """Return the noise with the measured `std` of a field (`field.info.noise_std`); None changes nothing."""
        return self if std is None else replace(self, std=std)

    def usual_std(self, field: Field) -> float:
        """Return the noise of most patches of a picture: a field that errs at few edges alone still shows its walls.

        It is at most three times the field's noise without outliers, where that was measured.
        """
        core = field.info.noise_core_std if isinstance(field, GridField) else None
        return self.std if core is None else min(self.std, _CORE * core)

    def alike_of(self, pixels: int, patches: float) -> float:
        """Return k of so many pixels of a picture of so many patches."""
        return 1 + pixels / (self.per_patch * patches)

    def doubt(self, squares: float, patches: float) -> float:
        """Return how many times less a picture tells than held-out views do, by the mean square of its differences."""
        return max(1.0, squares / self.std**2) * max(1.0, self.few_patches / patches) ** 2


@dataclass(frozen=True)
class FieldCamera:
    """A camera in a field."""

    field: Field
    """Map."""
    camera: Camera
    """Camera of the pictures."""
    mount: Pose
    """T_body_camera."""


@dataclass(frozen=True)
class Observation(FieldCamera):
    """Pixels of a picture, with the field and the camera that predict them."""

    pixels: Int[Tensor, "m 2"]
    """(u, v) of the pixels that are compared."""
    colors: Float[Tensor, "m 3"]
    """Their colours in [0, 1]."""

    @classmethod
    def of(
        cls,
        image: UInt8[Tensor, "height width 3"],
        pixels: Int[Tensor, "m 2"],
        view: FieldCamera,
    ) -> "Observation":
        """Read the given pixels of a picture."""
        colors = image[pixels[:, 1], pixels[:, 0]].float() / 255
        return cls(view.field, view.camera, view.mount, pixels, colors)

    def exposed(self, exposure: Float[Tensor, "2"]) -> "Observation":
        """Return the colours that the field should show, if this is the camera's gain less one, and bias."""
        return replace(self, colors=(self.colors - exposure[1]) / (1 + exposure[0]))

    def rays(self, state: RigidState) -> tuple[Float[Tensor, "m 3"], Float[Tensor, "m 3"]]:
        """Origins [m] and unit directions in the world, differentiable in the state's pose."""
        return self.camera.rays(state.pose.compose(self.mount), self.pixels)

    @torch.no_grad()
    def samples(self, state: RigidState) -> RaySamples:
        """Return the field's own samples along the pixels' rays."""
        return self.field.samples(*self.rays(state))

    def linearised(self, poses: Pose) -> tuple[Float[Tensor, "n m 3"], Float[Tensor, "n m 3 6"]]:
        """Return the field's colours from body poses (n,), and their derivative by position [1/m] and attitude [1/rad].

        The body's tangent is (dp, dtheta): p + dp, R Exp(dtheta). Its camera at R mount + p then moves and turns by

            d(centre) = dp + d(turn) x (R mount),   d(turn) = R dtheta
        """
        count, pixels = len(poses.position), len(self.pixels)
        cameras = poses.compose(self.mount)
        directions = self._in_camera @ cameras.rotation.transpose(-1, -2)
        origins = cameras.position[:, None].expand_as(directions)
        colors, by_camera = colors_and_jacobian(self.field, origins.reshape(-1, 3), directions.reshape(-1, 3))
        turned = by_camera.reshape(count, 3 * pixels, 6)
        arm = so3.hat((poses.rotation @ self.mount.position[:, None])[..., 0])
        moves = torch.cat([-arm @ poses.rotation, poses.rotation], 1)
        jacobian = torch.cat([turned[..., :3], turned @ moves], -1)
        return colors.reshape(count, pixels, 3), jacobian.reshape(count, pixels, 3, 6)

    @classmethod
    def slopes(cls, pose: Pose, view: FieldCamera, pixels: Int[Tensor, "m 2"]) -> Float[Tensor, "m 3 6"]:
        """Return the derivatives of any pixels' colours by the camera's motion, at one body pose.

        By d(centre) [1/m] and d(turn) [1/rad], in the world's axes.
        """
        blind = cls(view.field, view.camera, view.mount, pixels, torch.zeros(len(pixels), 3))
        with torch.no_grad():
            if (grid := get_ray_grid(blind.field)) is not None:
                rows = slopes(grid, blind.sight, array_of(pose.rotation), array_of(pose.position))
                return torch.from_numpy(rows).T.reshape(len(pixels), 3, 6)
            camera = pose.compose(blind.mount)
            directions = blind._in_camera @ camera.rotation.T
            return colors_and_jacobian(blind.field, camera.position.expand_as(directions), directions)[1]

    def shown(self, poses: Pose) -> Float[Tensor, "n m 3"]:
        """Return the field's colours from body poses (n,), without derivatives."""
        cameras = poses.compose(self.mount)
        directions = (self._in_camera @ cameras.rotation.transpose(-1, -2)).reshape(-1, 3)
        origins = cameras.position.repeat_interleave(len(self.pixels), 0)
        render = self.field.render_rays if isinstance(self.field, FastRenderer) else partial(render_rays, self.field)
        with torch.no_grad():
            color = torch.cat([
                render(*rays).color
                for rays in zip(origins.split(_RAYS_AT_ONCE), directions.split(_RAYS_AT_ONCE), strict=True)
            ])  # fmt: skip
        return color.reshape(len(poses.position), -1, 3)

    @cached_property
    def sight(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Arguments of the compiled descent: directions in the camera (m, 3), colours (m, 3), R and p of the mount."""
        directions, colors = (np.ascontiguousarray(part.numpy(), np.float32) for part in (self._in_camera, self.colors))
        return directions, colors, self.mount.rotation.double().numpy(), self.mount.position.double().numpy()

    @cached_property
    def _in_camera(self) -> Float[Tensor, "m 3"]:
        if self.camera.width * self.camera.height > _TABLED:
            return self.camera.directions(self.pixels)
        return _directions(self.camera)[self.pixels[:, 1] * self.camera.width + self.pixels[:, 0]]

    def residual(self, state: RigidState, samples: RaySamples | None = None) -> Float[Tensor, "m 3"]:
        """Return r_i: the field's colours less the picture's, differentiable twice in the state's pose.

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
        return before_backdrop(self.field, (origins, directions), density, color, samples).color - self.colors


@lru_cache(maxsize=8)
def _directions(camera: Camera) -> Float[Tensor, "hw 3"]:
    """Of all pixels, row by row: every stage of an update asks for some of them."""
    return camera.directions(camera.pixels())


def count_patches(image: UInt8[Tensor, "height width 3"], side: int = 10, noise_std: float = 0.0) -> float:
    """Count the patches of a picture, of `side` by `side`, that share its information: 1 where all edges are in one.

    With g a patch's sum of squared differences between neighbouring pixels, that is (sum g)^2 / sum g^2, times the
    share of g that stands out from errors of the field of `noise_std` [1 = full scale]: a patch whose colours vary by v
    is worth w = v / (v + noise_std^2) of one (Wiener's gain), and a blank wall in all patches alike is worth nothing.
    """
    grey = image.float().mean(-1)
    energy = torch.zeros_like(grey)
    energy[:, 1:] += grey.diff(dim=1).square()
    energy[1:] += grey.diff(dim=0).square()
    moments = torch.nn.functional.adaptive_avg_pool2d(torch.stack([energy, grey, grey.square()])[None], side)[0]
    shares, spread = moments[0], (moments[2] - moments[1].square()).clamp_min(0)
    share = shares * spread / (spread + (255 * noise_std) ** 2 + 1e-9)
    return max(1.0, float(shares.sum() * share.sum() / shares.square().sum().clamp_min(1e-9)))


def difference(residual: Float[Tensor, "m 3"]) -> Float[Tensor, " m"]:
    """Return the colour difference of each pixel, root mean square over the channels, in [0, 1]."""
    return residual.square().mean(-1).sqrt()


@torch.no_grad()
def inliers(residual: Float[Tensor, "m 3"], noise: ColorNoise) -> Bool[Tensor, " m"]:
    """Return the mask of inliers: those less than so many robust deviations above the median difference.

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
    """Return J_photo of the inliers."""
    return (residual.square().sum(-1) * believed).sum() / (noise.alike * noise.std**2)


def residuals(seen: Observation, poses: Pose) -> Float[Tensor, "n m 3"]:
    """Return the field's colours from body poses (n,) less the picture's."""
    return torch.from_numpy(shown(seen, poses)) - seen.colors


def shown(seen: Observation, poses: Pose) -> Float[np.ndarray, "n m 3"]:
    """Return the field's colours from body poses (n,), without derivatives."""
    grid = get_ray_grid(seen.field)
    with torch.no_grad(), threads(THREADS):
        if grid is None:
            return seen.shown(poses).numpy()
        colors = np.empty((len(poses.position), len(seen.pixels), 3), np.float32)
        probe(grid, seen.sight, array_of(poses.rotation), array_of(poses.position), colors)
        return colors
