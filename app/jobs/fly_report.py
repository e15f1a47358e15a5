"""Report of a flight: its numbers, its files and what the run store knows of it."""

from pathlib import Path
from typing import Any

from nerfnav.export import csv_text, episode_table, json_text
from nerfnav.navigation import Episode
from nerfnav_app.jobs.fly_request import FlyRequest
from nerfnav_app.jobs.recorded import TRAJECTORY
from nerfnav_app.places.place import Place
from nerfnav_app.storage.output_files import write_text
from nerfnav_app.storage.run_metadata import RunMetadata


def summary_of(episode: Episode, place: Place) -> dict[str, Any]:
    """What `fly --json` prints."""
    unjudged = {} if place.truth else {"mesh_collision_steps": None}
    return episode.metrics() | unjudged


def save(folder: Path, episode: Episode, place: Place) -> tuple[Path, ...]:
    """Write a flight's files into `folder`."""
    table = episode_table(episode, place.robot.action_names, place.robot.name)
    return (
        *episode.save(folder),
        write_text(folder / "trajectory.csv", csv_text(table)),
        write_text(folder / TRAJECTORY, json_text(table)),
    )


def metadata_of(request: FlyRequest, place: Place) -> RunMetadata:
    """What the run store knows of a flight before it is flown."""
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
