"""Real jobs that are small enough for tests in a browser."""

from functools import partial

from app.jobs import open_place as scene
from app.worker.backend import NavigationBackend
from nerfnav.estimator.descent import DescentConfig
from nerfnav.estimator.filter import FilterConfig
from nerfnav.estimator.noise import StateNoise
from nerfnav.estimator.pixels import PixelConfig
from nerfnav.navigation.mission import NavigateConfig
from nerfnav.planner.fast import FastPlanConfig
from tests.app.doubles import balls_place

_CALM = StateNoise(0.002, 0.002, 0.002, 0.002)  # so that a filter of few iterations keeps up


def small_work() -> NavigationBackend:
    """Real jobs among three balls, with few iterations."""
    pose_filter = FilterConfig(PixelConfig(count=64), DescentConfig(iterations=15), process_noise=_CALM)
    return NavigationBackend(
        open=partial(scene.run, opener=lambda _: balls_place()),
        plans={"fast": FastPlanConfig()},
        navigate=NavigateConfig(filter=pose_filter, noise=_CALM, initial=_CALM),
    )
