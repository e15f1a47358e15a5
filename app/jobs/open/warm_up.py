"""Warm-up: compile and cache what the first plan and flight in a place need."""

from collections.abc import Iterator
from contextlib import suppress

from nerfnav.core.errors import NerfnavError
from nerfnav_app.jobs.events import Progress
from nerfnav_app.jobs.fly.simulated_world import warm_up_filter, warm_up_renderer
from nerfnav_app.jobs.plan import plan
from nerfnav_app.places.ends import default_ends
from nerfnav_app.places.place import Place


def warm_up(place: Place) -> Iterator[Progress]:
    """Do once, small, what plans and flights will do: by then all is imported and compiled, and maps are made.

    Whoever does not want to wait for it may leave it at any step.
    """
    doing = Progress("getting ready", 0.6)
    yield doing
    if place.truth is not None:
        place.truth.load()
        yield doing
        warm_up_renderer()
        yield doing
    ends = default_ends(place, place.tasks[0].name if place.tasks else None)
    assert ends is not None
    request = plan.PlanRequest(ends)
    with suppress(NerfnavError):  # ends that nobody chose may be occupied
        for _ in plan.run(request, place):
            yield doing
    for _ in warm_up_filter(place, ends.start.state()):
        yield doing
