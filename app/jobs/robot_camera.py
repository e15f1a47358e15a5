"""What the field looks like to the robot's camera."""

import numpy as np

from app.places.place import Place
from nerfnav.field import render_image
from nerfnav.robots import RigidState


def view_from(place: Place, state: RigidState) -> np.ndarray:
    """The field as the robot's camera would see it from a state, (height, width, 3), sRGB bytes."""
    return render_image(place.field, place.robot.camera, state.pose.compose(place.robot.mount)).image.numpy()
