"""Real jobs that are small enough for tests in a browser."""

from collections.abc import Callable
from functools import cache, partial

from nerfnav.estimator.core.filter_config import DescentConfig, FilterConfig
from nerfnav.estimator.photometric.pixel_selection import PixelConfig
from nerfnav.geometry import Box
from nerfnav.navigation.flight import NavigateConfig
from nerfnav.planner.solvers.fast import FastPlanConfig
from nerfnav.robots import StateNoise
from nerfnav_app.jobs.open import opening as scene
from nerfnav_app.places.place import Place
from nerfnav_app.server import App
from nerfnav_app.state.actions import Adjust, Settings
from nerfnav_app.worker.backend import NavigationBackend
from tests.app.doubles import balls_place

_CALM = StateNoise(0.002, 0.002, 0.002, 0.002)  # so that a filter of few iterations keeps up
_ROOM = Box.of((-1.08, -1.08, -0.04), (1.08, 1.08, 0.84))
"""So large that ends are found where there is room to drag them about, and balls between them."""


def calm_flights(app: App) -> None:
    """Let little noise push the robot of the next flights, so that a filter of few iterations keeps up."""
    for name in ("position_noise_m", "attitude_noise_rad"):
        app.post(Adjust(Settings.FLIGHT, name, _CALM.position_m))


@cache
def roomy_place() -> Place:
    """Three balls, with room around them."""
    return balls_place(_ROOM)


def small_work(place: Callable[[], Place] = roomy_place) -> NavigationBackend:
    """Real jobs in a place, among three balls where nothing is said, with few iterations."""
    pose_filter = FilterConfig(pixels=PixelConfig(count=64), descent=DescentConfig(iterations=15), process_noise=_CALM)
    return NavigationBackend(
        open=partial(scene.run, opener=lambda _: place()),
        plans={"fast": FastPlanConfig()},
        navigate=NavigateConfig(filter=pose_filter, noise=_CALM, initial=_CALM),
    )
