"""The robot's camera, and what the field looks like to it."""

import numpy as np

from app.places.place import Place
from nerfnav.field import render_image
from nerfnav.geometry import FORWARD_MOUNT, Camera
from nerfnav.robots import RigidState

CAMERA = Camera.from_fov(200, 200, 90)
"""What the robot sees with: as wide as the field's own photographs."""


def view_from(place: Place, state: RigidState) -> np.ndarray:
    """The field as the robot's camera would see it from a state, (height, width, 3), sRGB bytes."""
    return render_image(place.field, CAMERA, state.pose.compose(FORWARD_MOUNT)).image.numpy()
