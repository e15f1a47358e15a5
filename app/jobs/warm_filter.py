"""Warm-up of a flight's steps: a first picture, a first update by it, and a first way to come to rest."""

from collections.abc import Iterator

import torch

from nerfnav.estimator import Belief, FastFilter, FilterStep
from nerfnav.field import render_image
from nerfnav.geometry import Camera
from nerfnav.navigation import NavigateConfig
from nerfnav.robots import RigidState
from nerfnav_app.places.place import Place


def first_update(place: Place, state: RigidState) -> Iterator[FilterStep]:
    """Correct a belief by a small picture of the field, taken where the robot believes to be, and hold there."""
    place.robot.held(state, torch.zeros(1, 3), dt=0.1, rest=0.0)
    camera = Camera.from_fov(64, 64, 90)
    picture = render_image(place.field, camera, state.pose.compose(place.robot.mount)).image
    belief, draws = Belief(state, NavigateConfig().initial.covariance()), torch.Generator().manual_seed(0)
    yield from FastFilter(place.field, place.robot, camera, place.robot.mount).correct(belief, picture, draws)
