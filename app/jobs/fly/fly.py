"""Fly job: Algorithm 1 in a simulated world, from a plan to an episode, its numbers, its files and its run metadata."""

from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import Any

from nerfnav.estimator import RelocaliseStep
from nerfnav.export import csv_text, episode_table, json_text
from nerfnav.field import VoxelField
from nerfnav.navigation import Episode, NavigationStep
from nerfnav.planner import FLYABLE, PlanOutcome, PlanResult
from nerfnav.robots import Motion
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, Progress
from nerfnav_app.jobs.export.recording import TRAJECTORY
from nerfnav_app.jobs.fly.command import command_of
from nerfnav_app.jobs.fly.request import FlyRequest, OperatorRecorder
from nerfnav_app.jobs.fly.setup import begin
from nerfnav_app.jobs.plan.plan import plan_steps
from nerfnav_app.places.ground import describe_move, put_on_ground
from nerfnav_app.places.place import Place
from nerfnav_app.storage.kept_obstacles import keep_obstacles
from nerfnav_app.storage.output_files import prepare_folder, write_text
from nerfnav_app.storage.run_metadata import RunMetadata
from nerfnav_app.storage.step_log import open_step_log


def summary_of(episode: Episode, place: Place) -> dict[str, Any]:
    """Summarize a flight as `fly --json` prints it."""
    placed = {} if place.obstacles is None else {"obstacles": len(place.obstacles.obstacles)}
    return episode.metrics() | ({} if place.truth else {"mesh_collision_steps": None}) | placed


def _describe_sightings(flown: list[NavigationStep]) -> dict[str, Any]:
    """Describe what a robot that watches has seen beside the map: in how many time steps, and when first."""
    if flown[-1].seen is None:
        return {}
    times = [step.time for step in flown if step.seen_movers is not None]
    return {"seen_steps": len(times), "first_seen_s": times[0] if times else None}


def save(folder: Path, episode: Episode, place: Place) -> tuple[Path, ...]:
    """Write a flight's files into `folder`."""
    table = episode_table(episode, place.robot.action_names, place.robot.name)
    return (
        *episode.save(folder),
        write_text(folder / "trajectory.csv", csv_text(table)),
        write_text(folder / TRAJECTORY, json_text(table)),
        *keep_obstacles(folder, place),
    )


def metadata_of(request: FlyRequest, place: Place, plan: Motion | None) -> RunMetadata:
    """Describe a flight by its first plan, or without one, for the run store before it is flown."""
    route = request.route
    dt, steps = (route.dt, None if route.shortest else route.steps) if plan is None else (plan.dt, len(plan.actions))
    return RunMetadata(
        place=place.name,
        source=request.source or place.name,
        robot=place.robot.source,
        planner=route.planner,
        estimator=request.estimator,
        seed=request.seed,
        dt=dt,
        ends=route.ends,
        task=request.task,
        open_loop=request.open_loop or route.flight.open_loop,
        unknown=route.unknown.value,
        plan_outcome=None if request.plan_outcome is None else request.plan_outcome.name.lower(),
        command=command_of(request, place, steps, dt),
    )


def run(request: FlyRequest, place: Place) -> JobEvents:
    """Fly: yield the steps of the flight, return its numbers and the files that were written.

    Send True to land early: the flight so far is then reported and stored, with the outcome "stopped".
    Raises NerfnavError where the request cannot be worked with.
    """
    given = request.route.ends
    ends = put_on_ground(place, given, request.route.unknown)
    request = replace(request, route=replace(request.route, ends=ends))
    out = None if request.out is None else prepare_folder(request.out)
    place = yield from _calibrated(place)
    plan = request.plan
    if plan is None:
        yield Progress("finding a way", 0.0)
        planned = yield from _first_plan(request, place)
        if planned is None or (request.cautious and planned.outcome not in FLYABLE):
            return JobResult({} if planned is None else {"outcome": planned.outcome.name.lower()})
        plan = None if planned.outcome is PlanOutcome.NO_PATH else planned.motion
        request = replace(request, plan_outcome=planned.outcome)
    operator = OperatorRecorder(request.operator, request.route.ends.goal.state())
    request, flown = replace(request, operator=operator), list[NavigationStep]()
    steps = request.route.steps if plan is None else len(plan.actions)
    about = metadata_of(request, place, plan)
    if out is not None:
        keep_obstacles(out, place)  # at take-off, as the log: a flight may be interrupted
    with open_step_log(out, about, lambda episode: summary_of(episode, place)) as log:
        for event in begin(request, plan, place):
            if log is not None and isinstance(event, NavigationStep):
                log.append(event)
                log.note_operator(operator.goal, operator.made)
            stop = yield event
            if isinstance(event, NavigationStep):
                flown.append(event)
                stop = (yield Progress("flying", min(1.0, event.index / steps))) or stop
            elif isinstance(event, RelocaliseStep):
                stop = (yield Progress("looking everywhere for the robot", event.fraction)) or stop
            if stop and flown:
                break
    episode = Episode.of(flown)
    summary = summary_of(episode, place) | describe_move(given, ends) | _describe_sightings(flown)
    return JobResult(summary, () if out is None else save(out, episode, place))


def _calibrated(place: Place) -> Generator[JobEvent, bool | None, Place]:
    """Calibrate a field by pictures of its ground truth where that was never done, as in one that was baked a moment
    ago, and in old files: a filter cannot rely on it."""
    field, scene = place.field, place.scene
    if not isinstance(field, VoxelField) or scene is None or not field.info.is_uncalibrated:
        return place
    from nerfnav_app.jobs.field.baked import calibrate  # slow to import, and seldom needed

    yield Progress("calibrating the field by pictures", 0.0)
    field, _ = yield from calibrate(field, scene)
    return replace(place, field=field)


def _first_plan(request: FlyRequest, place: Place) -> Generator[JobEvent, bool | None, PlanResult | None]:
    """Make the first plan, which is the one that `nerfnav plan` makes; None where the flight is stopped before."""
    steps, iterations = plan_steps(request.route, place), request.route.settings.iterations
    while True:
        try:
            step = next(steps)
        except StopIteration as end:
            yield end.value
            return end.value
        stop, done = False, 0.0
        if step is not None:
            stop, done = (yield step), min(1.0, (step.iteration + 1) / iterations)
        stop = (yield Progress("optimising the first plan", done)) or stop
        if stop:
            return None
