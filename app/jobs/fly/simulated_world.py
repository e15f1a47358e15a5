"""Simulated world of a flight: pictures of the robot's camera, contact with the ground truth, and a warm-up of both.

Camera and contact are those of the ground truth, or of the field where a place has none. The warm-up takes a first
picture, updates a first belief by it, and plans a first path to rest.
"""

from collections.abc import Iterator
from functools import partial

import cv2
import numpy as np
import torch

from nerfnav.estimator import Belief, FastFilter, FilterStep
from nerfnav.field import render_image
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose
from nerfnav.navigation import LEVEL, CameraAtTime, CameraFunction, ContactFunction, HiddenFunction, NavigateConfig
from nerfnav.robots import RigidState
from nerfnav_app.places.place import Place


def contact_function(place: Place) -> ContactFunction | None:
    """Make the contact check against the ground truth; None without one."""
    if place.scene is None:
        return None
    from nerfnav.world import contact_check  # slow to import, and people see the place before

    return contact_check(place.scene, place.robot.body)


def level_contact_function(place: Place) -> ContactFunction | None:
    """Make the check of landings against the ground truth; None without one."""
    if place.scene is None:
        return None
    from nerfnav.world import level_contact_check  # slow to import, as above

    return level_contact_check(place.scene, place.robot.body, LEVEL)


def camera_function(place: Place) -> CameraFunction:
    """Make the camera of the ground truth; of the field where there is none."""
    seen_with = place.robot.camera
    if place.scene is None:
        return lambda pose: render_image(place.field, seen_with, pose).image
    from nerfnav.world import MeshRenderer  # slow to import, as above

    renderer = MeshRenderer(place.scene, supersample=2)  # as the photographs that the field learned from
    return lambda pose: renderer.render(seen_with, pose).image


def camera_of_movers(place: Place) -> CameraAtTime | None:
    """Make the camera that shows obstacles where they move, too; None where none does."""
    if place.obstacles is None or not place.obstacles.moving:
        return None
    from nerfnav.obstacles import Overlay  # slow to import, as above
    from nerfnav.world import MeshRenderer

    seen_with, overlay = place.robot.camera, Overlay(place.obstacles.moving)
    renderer = None if place.scene is None else MeshRenderer(place.scene, supersample=2)

    def look(pose: Pose, time: float) -> torch.Tensor:
        if renderer is None:
            rendered = render_image(place.field, seen_with, pose)
            depth = torch.where(rendered.opacity > 0.5, rendered.depth, torch.inf)
            return overlay.draw(rendered.image, depth, seen_with, pose, time)
        picture = renderer.render(seen_with, pose)
        return overlay.draw(picture.image, picture.fine_depth, seen_with, pose, time)

    return look


def hidden_by_movers(place: Place) -> HiddenFunction | None:
    """Make the mask of the pixels in which announced movers stand before the field; None where none does."""
    if place.obstacles is None or not place.obstacles.announced:
        return None
    from nerfnav.obstacles import Overlay  # slow to import, as above

    return partial(Overlay(place.obstacles.announced).covered, place.robot.camera)


def warm_up_renderer() -> None:
    """Render one triangle, so that the renderer of ground truths is compiled."""
    import trimesh

    from nerfnav.world import MeshRenderer  # slow to import, as above

    nothing = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    MeshRenderer(nothing).render(Camera.from_fov(2, 2, 90), FORWARD_MOUNT)


_ROUGH = 1 / 3
"""Size of a rough picture: in flight a time step waits for it."""


def render_view(place: Place, state: RigidState, rough: bool = False) -> np.ndarray:
    """Render the field as the robot's camera would see it from a state, (height, width, 3), sRGB bytes.

    A rough picture has the same size, of fewer pixels.
    """
    camera = place.robot.camera
    looking = camera.scaled(_ROUGH) if rough else camera
    picture = render_image(place.field, looking, state.pose.compose(place.robot.mount)).image.numpy()
    return cv2.resize(picture, (camera.width, camera.height), interpolation=cv2.INTER_LINEAR) if rough else picture


def warm_up_filter(place: Place, state: RigidState) -> Iterator[FilterStep]:
    """Correct a belief by a small picture of the field from the believed state, and plan to hold there."""
    place.robot.roll_out_hold(state, torch.zeros(1, 3), dt=0.1, rest=0.0)
    camera = Camera.from_fov(64, 64, 90)
    picture = render_image(place.field, camera, state.pose.compose(place.robot.mount)).image
    belief, draws = Belief(state, NavigateConfig().initial.covariance()), torch.Generator().manual_seed(0)
    yield from FastFilter(place.field, place.robot, camera, place.robot.mount).correct(belief, picture, draws)
