"""Fly: Algorithm 1 in a simulated world, from a plan to an episode."""

from dataclasses import replace

from nerfnav.estimator import RelocaliseStep
from nerfnav.navigation import Episode, NavigationStep
from nerfnav.planner import GOOD, PlanStep
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.fly.request import FlyRequest, WatchedOrders
from nerfnav_app.jobs.fly.setup import begin, timed
from nerfnav_app.jobs.fly_report import metadata_of, save, summary_of
from nerfnav_app.places.place import Place
from nerfnav_app.storage.output_files import prepare_folder
from nerfnav_app.storage.step_log import logged


def run(request: FlyRequest, place: Place) -> JobEvents:
    """Yield what planner, filter and loop yield; return the numbers of the flight and what was written.

    Send True to land early: the flight so far is then reported and stored, with the outcome "stopped".
    Raises NerfnavError where the request cannot be worked with.
    """
    out = None if request.out is None else prepare_folder(request.out)
    yield Progress("finding a way", 0.0)
    watched = WatchedOrders(request.orders)
    request = timed(replace(request, orders=watched), place)
    flown: list[NavigationStep] = []
    with logged(out, metadata_of(request, place), lambda episode: summary_of(episode, place)) as log:
        for event in begin(request, place):
            if log is not None and isinstance(event, NavigationStep):
                log.append(event)
                log.head_for(watched.goal)
            stop = yield event
            if isinstance(event, NavigationStep):
                flown.append(event)
                stop = (yield Progress("flying", min(1.0, event.index / request.route.steps))) or stop
            elif isinstance(event, PlanStep) and not flown:
                fraction = min(1.0, (event.iteration + 1) / request.route.settings.iterations)
                stop = (yield Progress("optimising the first plan", fraction)) or stop
                if event.outcome is not None and request.plan is None:
                    if request.cautious and event.outcome not in GOOD:
                        return JobResult({"outcome": event.outcome.name.lower()})
                    request = replace(request, plan=event.motion)  # what follows is planned again from the belief
            elif isinstance(event, RelocaliseStep):
                stop = (yield Progress("looking everywhere for the robot", event.fraction)) or stop
            if stop and flown:
                break
    episode = Episode.of(flown)
    summary = summary_of(episode, place)
    return JobResult(summary, () if out is None else save(out, episode, place))
