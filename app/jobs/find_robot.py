"""Find: where is the robot, by its last picture alone?"""

from jaxtyping import UInt8
from torch import Tensor

from app.jobs.events import JobEvents
from app.jobs.localize import search
from app.places.derived import searcher_of
from app.places.place import Place
from nerfnav.estimator import ColorNoise


def find(place: Place, image: UInt8[Tensor, "height width 3"]) -> JobEvents:
    """Localize a picture that the robot's own camera has taken in an open place."""
    noise = ColorNoise().measured(place.field.info.noise_std)
    return search(searcher_of(place, place.robot.camera, noise), image)
