"""Find: where is the robot, by its last picture alone?"""

from jaxtyping import UInt8
from torch import Tensor

from nerfnav.estimator import ColorNoise
from nerfnav_app.jobs.events import JobEvents
from nerfnav_app.jobs.localize import search
from nerfnav_app.places.derived import searcher_of
from nerfnav_app.places.place import Place


def find(place: Place, image: UInt8[Tensor, "height width 3"]) -> JobEvents:
    """Localize a picture that the robot's own camera has taken in an open place."""
    noise = ColorNoise().measured(place.field.info.noise_std)
    return search(searcher_of(place, place.robot.camera, noise), image)
