"""Panoramas of a field from many places, and the places and headings at which a picture fits them.

A panorama has a row for each elevation and a column for each azimuth, so that another heading is another column. For
a picture that is laid into the panorama's grid (w_i its pixels in cell i, x_i their mean colour), every heading s of
every place needs three sums over cells,

    sum w_i P_{i+s},   sum w_i |P_{i+s}|^2,   sum w_i x_i P_{i+s},

which are correlations along the rows: products of their Fourier transforms, for all places at once. With <> the mean
over weights and channels, and d = x - P, they give how well the camera's gain 1 + h and bias b explain the picture,

    min over h, b of <(d - h P - b)^2> + k_h h^2 + k_b b^2 = <d^2> - s' [<P^2> + k_h, <P>; <P>, 1 + k_b]^-1 s

with s = (<d P>, <d>): ridge regression (Hoerl and Kennard 1970), `misfit`. Without k a gain of nothing would make any
place explain a picture of hardly any contrast.

`PanoramaIndex` holds the panoramas of one field: they are rendered once and compared with many pictures.
"""

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import partial

import torch
from jaxtyping import Complex, Float, UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.jit import threads
from nerfnav.estimator.photometric.pyramid import View, resize_picture
from nerfnav.estimator.photometric.residuals import THREADS
from nerfnav.field import FastRenderer, Field, build_levels, render_rays
from nerfnav.geometry import (
    FORWARD_MOUNT,
    Box,
    Camera,
    Pose,
    check_image,
    downsample_image,
    node_positions,
    shape_for,
    so3,
)

_ROWS, _COLUMNS = 24, 64
"""Cells of a panorama: 5.6 degrees each."""
_HIGHEST = math.radians(67)
"""Elevation of its upper edge, and below the horizon of its lower one: corners of a tilted wide picture."""
COLUMN = 2 * math.pi / _COLUMNS
"""Azimuth from one column to the next [rad]."""
_PLACES_AT_ONCE = 64
_ROOM, _FREE = 0.02, 2.6
"""Room around a camera [longest edges of the box], and density that still counts as free [in one such edge]."""
_COARSER = 1.15
"""Factor on the distance of places while there are too many."""


@dataclass(frozen=True)
class Panoramas:
    """The Fourier transforms of panoramas along their rows: f frequencies, r rows."""

    places: Float[Tensor, "n 3"]
    """Where they were taken [m]."""
    colors: Complex[Tensor, "f n r3"]
    """Of the colours."""
    sums: Complex[Tensor, "f n r"]
    """Of the sum of the three channels."""
    squares: Complex[Tensor, "f n r"]
    """Of the sum of their squares."""

    @classmethod
    def render(cls, field: Field, places: Float[Tensor, "n 3"]) -> Generator[float, None, "Panoramas"]:
        """Render panoramas from every place [m], step by step; yields the share of the places that is done."""
        directions = _directions().reshape(-1, 3)
        render = field.render_rays if isinstance(field, FastRenderer) else partial(render_rays, field)
        parts, batches = [], places.split(_PLACES_AT_ONCE)
        for some in batches:
            origins = some.repeat_interleave(len(directions), 0)
            with torch.no_grad(), threads(THREADS):
                color = render(origins, directions.repeat(len(some), 1)).color
            parts.append(color.reshape(len(some), _ROWS, _COLUMNS, 3))
            yield len(parts) / len(batches)
        seen = torch.cat(parts)
        return cls(
            places, _spectrum(seen), _spectrum(seen.sum(-1, keepdim=True)), _spectrum(seen.square().sum(-1, True))
        )

    def misfit(
        self,
        colors: Float[Tensor, "m 3"],
        directions: Float[Tensor, "m 3"],
        tilts: Float[Tensor, "t 3 3"],
        exposure: tuple[float, float],
    ) -> Float[Tensor, "n t h"]:
        """Return the misfit of pixels, as a mean square, for each place, tilt and heading; `exposure` is (k_h, k_b).

        `colors` in [0, 1]; `directions` are unit vectors in the level frame of a carrier that looks along x (FLU), and
        a carrier's attitude is Rz(h COLUMN) tilt.
        """
        laid = [_laid(colors, directions @ tilt.T) for tilt in tilts]
        weights, means = torch.stack([w for w, _ in laid])[..., None], torch.stack([x for _, x in laid])
        known = _spectrum(weights).conj()
        total = 3 * weights.sum((1, 2, 3)).clamp_min(1)[:, None]
        mean, square = _turned(self.sums, known) / total, _turned(self.squares, known) / total
        together = _turned(self.colors, _spectrum(weights * means).conj()) / total
        own = (weights * means).sum((1, 2, 3))[:, None] / total
        own_square = (weights * means.square()).sum((1, 2, 3))[:, None] / total
        by_gain, by_bias = together - square, own - mean
        stiff, free = square + exposure[0], 1 + exposure[1]
        explained = free * by_gain.square() - 2 * mean * by_gain * by_bias + stiff * by_bias.square()
        return own_square - 2 * together + square - explained / (stiff * free - mean.square())


def find_free_places(field: Field, spacing: float) -> Float[Tensor, "n 3"]:
    """Points in the box that a camera could be at, on a grid [m]: no density there, nor `_ROOM` around."""
    size = float(field.box.size.max())
    room = _ROOM * size
    inner = Box(field.box.lower + room, field.box.upper - room)
    points = node_positions(inner, shape_for(inner, spacing)).reshape(-1, 3)
    around = torch.cat([torch.zeros(1, 3), room * torch.eye(3), -room * torch.eye(3)])
    with torch.no_grad():
        density = field.density(points[:, None] + around).amax(-1)
    return points[density < _FREE / size]


def thin_places(places: Float[Tensor, "n 3"], spacing: float, most: int) -> Float[Tensor, "m 3"]:
    """One of the places in each cell of a grid [m], whose cells grow until there are no more than `most`."""
    while True:
        cells = torch.unique((places / spacing).round().long(), dim=0, return_inverse=True)[1]
        count = int(cells.max()) + 1
        if count <= most:
            break
        spacing *= _COARSER
    first = torch.full((count,), len(places)).scatter_reduce(0, cells, torch.arange(len(places)), "amin")
    return places[first]


def list_tilts(pitches: tuple[float, ...], rolls: tuple[float, ...]) -> Float[Tensor, "t 3 3"]:
    """Attitudes of carriers that head along x, for each pitch and roll [rad]."""
    angles = torch.cartesian_prod(torch.tensor(pitches), torch.tensor(rolls)).reshape(-1, 2)
    zero = torch.zeros(len(angles))
    pitched = so3.exp(torch.stack([zero, angles[:, 0], zero], -1))
    return pitched @ so3.exp(torch.stack([angles[:, 1], zero, zero], -1))


def _directions() -> Float[Tensor, "r c 3"]:
    """Unit vectors of the cells, in the world."""
    elevation = _HIGHEST * ((torch.arange(_ROWS) + 0.5) / _ROWS * 2 - 1)[:, None].expand(-1, _COLUMNS)
    azimuth = (torch.arange(_COLUMNS) * COLUMN).expand(_ROWS, -1)
    level = elevation.cos()
    return torch.stack([level * azimuth.cos(), level * azimuth.sin(), elevation.sin()], -1)


def _laid(
    colors: Float[Tensor, "m 3"], directions: Float[Tensor, "m 3"]
) -> tuple[Float[Tensor, "r c"], Float[Tensor, "r c 3"]]:
    """Return the number of pixels in each cell, and their mean colour."""
    x, y, z = directions.unbind(-1)
    column = torch.round(torch.atan2(y, x) / COLUMN).long() % _COLUMNS
    row = torch.floor((torch.asin(z.clamp(-1, 1)) / _HIGHEST + 1) / 2 * _ROWS).long()
    inside = (row >= 0) & (row < _ROWS)
    cell = (row * _COLUMNS + column)[inside]
    count = torch.zeros(_ROWS * _COLUMNS).index_add(0, cell, torch.ones(len(cell)))
    total = torch.zeros(_ROWS * _COLUMNS, 3).index_add(0, cell, colors[inside])
    mean = total / count.clamp_min(1)[:, None]
    return count.reshape(_ROWS, _COLUMNS), mean.reshape(_ROWS, _COLUMNS, 3)


def _spectrum(panoramas: Float[Tensor, "n r c k"]) -> Complex[Tensor, "f n rk"]:
    return torch.fft.rfft(panoramas, dim=2).permute(2, 0, 1, 3).flatten(2)


def _turned(seen: Complex[Tensor, "f n rk"], laid: Complex[Tensor, "f t rk"]) -> Float[Tensor, "n t h"]:
    """Sums over cells of the products, for every place n, tilt t and turn h."""
    return torch.fft.irfft((seen @ laid.transpose(1, 2)).permute(1, 2, 0), n=_COLUMNS, dim=-1)


_LARGEST = 256
"""Larger pictures are halved until they have no more pixels along their longer edge than twice this."""
_ITSELF = Pose(torch.eye(3), torch.zeros(3))


@dataclass(frozen=True)
class PanoramaConfig:
    """Options of the panoramas."""

    spacing: float = 0.046
    """Distance of the places that are looked from [longest edges of the box]; wider where there would be too many."""
    most_places: int = 4000
    """Places at most."""
    pitches: tuple[float, ...] = (-0.4, -0.2, 0.0, 0.2, 0.4)
    """Pitches tried at each place and heading [rad]."""
    rolls: tuple[float, ...] = (-0.25, 0.0, 0.25)
    """Rolls tried with each [rad]."""
    levels: int = 4
    """Levels of sharpness that pictures are compared at (see field/models/levels.py); the coarsest one is looked at
    first."""


@dataclass(frozen=True)
class PanoramaIndex:
    """Panoramas of a field from many places: rendered once, compared with many pictures."""

    camera: Camera
    """What takes the pictures."""
    view: View
    """The field at all levels, and the camera at the origin of its own frame, with no more pixels than are needed."""
    panoramas: Panoramas
    """The field all around every place."""
    tilts: Float[Tensor, "t 3 3"]
    """Attitudes tried at each place, of a camera's carrier that heads along x."""

    @classmethod
    def render(
        cls,
        field: Field,
        camera: Camera,
        places: Float[Tensor, "n 3"],
        config: PanoramaConfig,
        tilts: Float[Tensor, "t 3 3"] | None = None,
    ) -> Generator[float, None, "PanoramaIndex"]:
        """Render from all `places` [m] at least `spacing` apart; with `tilts` from all places, held like that.

        Yields the share that is done. Raises InvalidInputError where there is no place to look from.
        """
        if len(places) == 0:
            raise InvalidInputError("there is no free place in the field that a robot could be at")
        view = View(build_levels(field, config.levels), _reduce(camera), _ITSELF)
        if tilts is None:
            places = thin_places(places, config.spacing * float(field.box.size.max()), config.most_places)
            tilts = list_tilts(config.pitches, config.rolls)
        panoramas = yield from Panoramas.render(view.levels[-1], places)
        return cls(camera, view, panoramas, tilts)

    def with_camera(self, camera: Camera) -> "PanoramaIndex":
        """Return the same panoramas for pictures of another camera."""
        return replace(self, camera=camera, view=replace(self.view, camera=_reduce(camera)))

    def fitted(self, image: UInt8[Tensor, "height width 3"]) -> UInt8[Tensor, "h w 3"]:
        """Resize a picture to the pixels of `view`. Raises InvalidInputError for one that is not the camera's."""
        check_image(image, self.camera)
        return resize_picture(image, self.view.camera)

    def likeliest(
        self, image: UInt8[Tensor, "h w 3"], most: int, exposure: tuple[float, float]
    ) -> tuple[Pose, Float[Tensor, " m"]]:
        """Return the poses T_world_camera, `most` of them, from which the field looks most like a picture, best first.

        Returned with their misfits, mean squares of colour (see `Panoramas.misfit`, also for `exposure`). Only headings
        that fit better than their neighbours on either side count.
        """
        halvings = max(0, math.floor(math.log2(max(1.0, 0.5 * COLUMN * self.view.camera.fx))))
        small = self.view.camera.scaled(0.5**halvings)
        ahead = small.directions(small.pixels()) @ FORWARD_MOUNT.rotation.T
        misfit, tilt = self.panoramas.misfit(downsample_image(image, small), ahead, self.tilts, exposure).min(1)
        dip = (misfit <= misfit.roll(1, -1)) & (misfit <= misfit.roll(-1, -1))
        dips = torch.where(dip, misfit, torch.inf).flatten()
        value, index = dips.topk(min(most, int(dip.sum())), largest=False)
        place, heading = index // misfit.shape[1], index % misfit.shape[1]
        rotation = so3.from_yaw(COLUMN * heading) @ self.tilts[tilt.flatten()[index]] @ FORWARD_MOUNT.rotation
        return Pose(rotation, self.panoramas.places[place]), value


def _reduce(camera: Camera) -> Camera:
    """Return the camera with no more pixels than are needed."""
    halvings = max(0, math.floor(math.log2(max(camera.width, camera.height) / _LARGEST)))
    return camera.scaled(0.5**halvings)
