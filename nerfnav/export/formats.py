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
from nerfnav.export.tables import csv_text, json_text
from nerfnav.export.tum import tum, tum_estimate


@dataclass(frozen=True)
class Format:
    """A format."""

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


FORMATS: dict[str, Format] = {
    "csv": Format("csv", "a table for spreadsheets", lambda made: Exported(csv_text(made.table).encode())),
    "json": Format("json", "the table with units and frames", lambda made: Exported(json_text(made.table).encode())),
    "tum": Format("tum", "the true path for trajectory evaluation", tum),
    "tum-estimate": Format("tum", "the estimated path for trajectory evaluation", tum_estimate, True),
    "px4": Format("csv", "setpoints in NED for PX4's offboard mode", px4),
    "crazyflie": Format("csv", "polynomials for the Crazyflie's high-level commander", crazyflie),
    "mcap": Format("mcap", "ROS 2 messages for Foxglove and ros2 bag", mcap),
    "rosbag2": Format("zip", "a ROS 2 bag, zipped", rosbag2),
    "gltf": Format("glb", "the path and the moving robot for Blender", gltf),
    "html": Format("html", "a replay that opens in any browser, without a server", replay, True, True),
}
"""Name to format."""
