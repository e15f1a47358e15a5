"""What the field looks like to the robot's camera."""

import cv2
import numpy as np

from nerfnav.field import render_image
from nerfnav.robots import RigidState
from nerfnav_app.places.place import Place

_ROUGH = 1 / 3
"""Size of a rough picture: in flight a time step waits for it."""


def view_from(place: Place, state: RigidState, rough: bool = False) -> np.ndarray:
    """The field as the robot's camera would see it from a state, (height, width, 3), sRGB bytes.

    Rough, it is made of fewer pixels, and as large.
    """
    camera = place.robot.camera
    looking = camera.scaled(_ROUGH) if rough else camera
    picture = render_image(place.field, looking, state.pose.compose(place.robot.mount)).image.numpy()
    return cv2.resize(picture, (camera.width, camera.height), interpolation=cv2.INTER_LINEAR) if rough else picture
