"""Fly job: Algorithm 1 in a simulated world, from a plan to an episode, its numbers, its files and its run metadata."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from nerfnav.estimator import RelocaliseStep
from nerfnav.export import csv_text, episode_table, json_text
from nerfnav.navigation import Episode, NavigationStep
from nerfnav.planner import FLYABLE, PlanResult, PlanStep
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.export.recording import TRAJECTORY
from nerfnav_app.jobs.fly.request import FlyRequest, GoalRecorder
from nerfnav_app.jobs.fly.setup import begin, set_duration
from nerfnav_app.places.place import Place
from nerfnav_app.storage.output_files import prepare_folder, write_text
from nerfnav_app.storage.run_metadata import RunMetadata
from nerfnav_app.storage.step_log import open_step_log


def summary_of(episode: Episode, place: Place) -> dict[str, Any]:
    """Summarize a flight as `fly --json` prints it."""
    return episode.metrics() | ({} if place.truth else {"mesh_collision_steps": None})


def save(folder: Path, episode: Episode, place: Place) -> tuple[Path, ...]:
    """Write a flight's files into `folder`."""
    table = episode_table(episode, place.robot.action_names, place.robot.name)
    return (
        *episode.save(folder),
        write_text(folder / "trajectory.csv", csv_text(table)),
        write_text(folder / TRAJECTORY, json_text(table)),
    )


def metadata_of(request: FlyRequest, place: Place) -> RunMetadata:
    """Describe a flight for the run store before it is flown."""
    route = request.route
    return RunMetadata(
        place=place.name,
        source=request.source or place.name,
        robot=place.robot.source,
        planner=route.planner,
        estimator=request.estimator,
        seed=request.seed,
        dt=route.dt,
        ends=route.ends,
        task=request.task,
        open_loop=request.open_loop or request.config.open_loop,
        unknown=route.unknown.value,
    )


def run(request: FlyRequest, place: Place) -> JobEvents:
    """Fly: yield the steps of the flight, return its numbers and the files that were written.

    Send True to land early: the flight so far is then reported and stored, with the outcome "stopped".
    Raises NerfnavError where the request cannot be worked with.
    """
    out = None if request.out is None else prepare_folder(request.out)
    yield Progress("finding a way", 0.0)
    operator = GoalRecorder(request.operator)
    request = set_duration(replace(request, operator=operator), place)
    flown: list[NavigationStep] = []
    with open_step_log(out, metadata_of(request, place), lambda episode: summary_of(episode, place)) as log:
        for event in begin(request, place):
            if log is not None and isinstance(event, NavigationStep):
                log.append(event)
                log.note_goal(operator.goal)
            stop = yield event
            if isinstance(event, NavigationStep):
                flown.append(event)
                stop = (yield Progress("flying", min(1.0, event.index / request.route.steps))) or stop
            elif isinstance(event, PlanStep) and not flown:
                fraction = min(1.0, (event.iteration + 1) / request.route.settings.iterations)
                stop = (yield Progress("optimising the first plan", fraction)) or stop
                if isinstance(event, PlanResult) and request.plan is None:
                    if request.cautious and event.outcome not in FLYABLE:
                        return JobResult({"outcome": event.outcome.name.lower()})
                    request = replace(request, plan=event.motion)  # what follows is planned again from the belief
            elif isinstance(event, RelocaliseStep):
                stop = (yield Progress("looking everywhere for the robot", event.fraction)) or stop
            if stop and flown:
                break
    episode = Episode.of(flown)
    summary = summary_of(episode, place)
    return JobResult(summary, () if out is None else save(out, episode, place))
