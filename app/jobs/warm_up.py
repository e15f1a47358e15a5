"""Warm-up: compile and cache what the first plan and flight in a place need."""

from collections.abc import Iterator
from contextlib import suppress

import torch

from app.jobs import plan
from app.jobs.events import Progress
from app.jobs.plan_request import PlanRequest
from app.places.ends import opening_ends
from app.places.place import Place
from nerfnav.errors import NerfnavError
from nerfnav.estimator.belief import Belief
from nerfnav.estimator.fast import FastFilter
from nerfnav.field.render import render_image
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera
from nerfnav.navigation.replan import NavigateConfig


def warm_up(place: Place) -> Iterator[Progress]:
    """Do once, small, what plans and flights will do: by then all is imported and compiled, and maps are made.

    Whoever does not want to wait for it may leave it at any step.
    """
    doing = Progress("compiling kernels, which takes longer the first time", 0.6)
    yield doing
    if place.truth is not None:
        place.truth.load()
        yield doing
    ends = opening_ends(place, place.tasks[0].name if place.tasks else None)
    assert ends is not None
    request = PlanRequest(ends)
    with suppress(NerfnavError):  # ends that nobody chose may be occupied
        for _ in plan.run(request, place):
            yield doing
    start, camera = ends.start.state(), Camera.from_fov(64, 64, 90)
    picture = render_image(place.field, camera, start.pose.compose(FORWARD_MOUNT)).image
    belief, draws = Belief(start, NavigateConfig().initial.covariance()), torch.Generator().manual_seed(0)
    for _ in FastFilter(place.field, place.robot, camera).correct(belief, picture, draws):
        yield doing
