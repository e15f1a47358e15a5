"""All formats in which a plan or a flight can be taken away: name, ending, what it is for, and what makes it."""

from collections.abc import Callable
from dataclasses import dataclass

from nerfnav.export.crazyflie import crazyflie
from nerfnav.export.gltf import gltf
from nerfnav.export.px4 import px4
from nerfnav.export.recording import Exported, Recording
from nerfnav.export.replay import replay
from nerfnav.export.ros.mcap import mcap
from nerfnav.export.ros.rosbag2 import rosbag2
from nerfnav.export.table_text import csv_text, json_text
from nerfnav.export.tum import tum, tum_estimate
from nerfnav.registry import Registry


@dataclass(frozen=True)
class ExportFormat:
    """A format."""

    name: str
    """What users call it, as in `--format`."""
    ending: str
    """Of its files."""
    purpose: str
    """What it is for, in a few words."""
    make: Callable[[Recording], Exported]
    """Makes the content of a file."""
    flights_only: bool = False
    """Whether plans have nothing to put into it."""
    shows_place: bool = False
    """Whether the surface of the place goes into it."""


def _csv(made: Recording) -> Exported:
    return Exported(csv_text(made.table).encode())


def _json(made: Recording) -> Exported:
    return Exported(json_text(made.table).encode())


FORMATS: Registry[ExportFormat] = Registry("format", (
    ExportFormat("csv", "csv", "a table for spreadsheets", _csv),
    ExportFormat("json", "json", "the table with units and frames", _json),
    ExportFormat("tum", "tum", "the true path for trajectory evaluation", tum),
    ExportFormat("tum-estimate", "tum", "the estimated path for trajectory evaluation", tum_estimate, True),
    ExportFormat("px4", "csv", "setpoints in NED for PX4's offboard mode", px4),
    ExportFormat("crazyflie", "csv", "polynomials for the Crazyflie's high-level commander", crazyflie),
    ExportFormat("mcap", "mcap", "ROS 2 messages for Foxglove and ros2 bag", mcap),
    ExportFormat("rosbag2", "zip", "a ROS 2 bag, zipped", rosbag2),
    ExportFormat("gltf", "glb", "the path and the moving robot for Blender", gltf),
    ExportFormat("html", "html", "a replay that opens in any browser, without a server", replay, True, True),
))  # fmt: skip
"""Name to format."""


def register(form: ExportFormat) -> None:
    """Make a format known by its name. Raises NameTakenError where another one has it."""
    FORMATS.register(form)
