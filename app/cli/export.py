"""nerfnav export: trajectories for other programs."""

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from app.cli.terminal import follow, show
from app.jobs.export import ExportRequest
from app.jobs.export import run as run_job


@dataclass(frozen=True)
class Arguments:
    """Write the trajectory of a plan or a flight in another format.

    Formats: csv, json (tables); tum, tum-estimate (for evaluation); px4, crazyflie (setpoints, polynomials); mcap,
    rosbag2 (ROS 2); gltf (the path and the moving robot); html (a replay that needs no server).
    """

    run: Positional[Path]
    """Folder that `nerfnav plan --out` or `nerfnav fly` wrote, or the name of a flight in runs/."""
    format: str
    """csv, json, tum, tum-estimate, px4, crazyflie, mcap, rosbag2, gltf or html."""
    out: Path
    """File to write."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Export, and tell what was written."""
    request = ExportRequest(arguments.run, arguments.format, arguments.out)
    show("export", follow(run_job(request)).summary, arguments.json)
