"""What a field looks like from everywhere, and from where it looks like a picture."""

import math
from collections.abc import Generator
from dataclasses import dataclass

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.estimator.panorama import COLUMN, Panoramas, thinned, tilts_of
from nerfnav.estimator.pyramid import View
from nerfnav.field import Field, levels_of
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, check_image, reduced, so3
from nerfnav.steps import returned

_LARGEST = 256
"""Larger pictures are halved until they have no more pixels along their longer edge than twice this."""
_ITSELF = Pose(torch.eye(3), torch.zeros(3))


@dataclass(frozen=True)
class LooksConfig:
    """From where a field is looked at."""

    spacing: float = 0.046
    """Distance of the places that are looked from [longest edges of the box]; wider where there would be too many."""
    most_places: int = 4000
    """Places at most."""
    pitches: tuple[float, ...] = (-0.4, -0.2, 0.0, 0.2, 0.4)
    """Pitches tried at each place and heading [rad]."""
    rolls: tuple[float, ...] = (-0.25, 0.0, 0.25)
    """Rolls tried with each [rad]."""
    levels: int = 4
    """Levels of sharpness that pictures are compared at (see field/levels.py); the coarsest one is looked at first."""


@dataclass(frozen=True)
class Looks:
    """What a field looks like from everywhere: made once, asked often."""

    camera: Camera
    """What takes the pictures."""
    view: View
    """The field at all levels, and the camera at the origin of its own frame, with no more pixels than are needed."""
    panoramas: Panoramas
    """The field all around every place."""
    tilts: Float[Tensor, "t 3 3"]
    """Attitudes tried at each place, of a camera's carrier that heads along x."""

    @classmethod
    def of(
        cls,
        field: Field,
        camera: Camera,
        places: Float[Tensor, "n 3"],
        config: LooksConfig | None = None,
        tilts: Float[Tensor, "t 3 3"] | None = None,
    ) -> "Looks":
        """Look from all `places` [m] that are at least `spacing` apart, all around; with `tilts` from all places, held
        like that.

        Raises InvalidInputError where there is no place to look from.
        """
        return returned(cls.looking(field, camera, places, config, tilts))

    @classmethod
    def looking(
        cls,
        field: Field,
        camera: Camera,
        places: Float[Tensor, "n 3"],
        config: LooksConfig | None = None,
        tilts: Float[Tensor, "t 3 3"] | None = None,
    ) -> Generator[float, None, "Looks"]:
        """`of`, step by step; yields the share that is done."""
        config = LooksConfig() if config is None else config
        if len(places) == 0:
            raise InvalidInputError("there is no free place in the field that a robot could be at")
        halvings = max(0, math.floor(math.log2(max(camera.width, camera.height) / _LARGEST)))
        view = View(levels_of(field, config.levels), camera.scaled(0.5**halvings), _ITSELF)
        if tilts is None:
            places = thinned(places, config.spacing * float(field.box.size.max()), config.most_places)
            tilts = tilts_of(config.pitches, config.rolls)
        panoramas = yield from Panoramas.looking(view.levels[-1], places)
        return cls(camera, view, panoramas, tilts)

    def fitted(self, image: UInt8[Tensor, "height width 3"]) -> UInt8[Tensor, "h w 3"]:
        """A picture with the pixels of `view`. Raises InvalidInputError for one that is not the camera's."""
        check_image(image, self.camera)
        small = self.view.camera
        if small.width == self.camera.width:
            return image
        return (255 * reduced(image, small)).round().to(torch.uint8).reshape(small.height, small.width, 3)

    def likeliest(
        self, image: UInt8[Tensor, "h w 3"], most: int, exposure: tuple[float, float]
    ) -> tuple[Pose, Float[Tensor, " m"]]:
        """The poses T_world_camera, `most` of them, from which the field looks most like a picture, best first.

        Told with their misfits, mean squares of colour (see `Panoramas.misfit`, also for `exposure`). Only headings
        that fit better than their neighbours on either side count.
        """
        halvings = max(0, math.floor(math.log2(max(1.0, 0.5 * COLUMN * self.view.camera.fx))))
        small = self.view.camera.scaled(0.5**halvings)
        ahead = small.directions(small.pixels()) @ FORWARD_MOUNT.rotation.T
        misfit, tilt = self.panoramas.misfit(reduced(image, small), ahead, self.tilts, exposure).min(1)
        dip = (misfit <= misfit.roll(1, -1)) & (misfit <= misfit.roll(-1, -1))
        dips = torch.where(dip, misfit, torch.inf).flatten()
        value, index = dips.topk(min(most, int(dip.sum())), largest=False)
        place, heading = index // misfit.shape[1], index % misfit.shape[1]
        rotation = so3.from_yaw(COLUMN * heading) @ self.tilts[tilt.flatten()[index]] @ FORWARD_MOUNT.rotation
        return Pose(rotation, self.panoramas.places[place]), value
