"""Simulated world of a flight: the robot's camera and its contact with the ground truth of a place."""

from nerfnav.field import render_image
from nerfnav.geometry import FORWARD_MOUNT, Camera
from nerfnav.navigation import CameraFunction, ContactFunction
from nerfnav_app.places.place import Place


def contact_function(place: Place) -> ContactFunction | None:
    """What tells whether the robot touches the ground truth; None where there is none."""
    if place.scene is None:
        return None
    from nerfnav.world import contact_check  # slow to import, and people see the place before

    return contact_check(place.scene, place.robot.body)


def camera_function(place: Place) -> CameraFunction:
    """Pictures of the ground truth; of the field where there is none."""
    seen_with = place.robot.camera
    if place.scene is None:
        return lambda pose: render_image(place.field, seen_with, pose).image
    from nerfnav.world import MeshRenderer  # slow to import, as above

    renderer = MeshRenderer(place.scene, supersample=2)  # as the photographs that the field learned from
    return lambda pose: renderer.render(seen_with, pose).image


def first_picture() -> None:
    """Look at next to nothing: by then what makes pictures of ground truths is compiled."""
    import trimesh

    from nerfnav.world import MeshRenderer  # slow to import, as above

    nothing = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    MeshRenderer(nothing).render(Camera.from_fov(2, 2, 90), FORWARD_MOUNT)
