"""nerfnav live: localization and setpoints for a real robot, at a local socket."""

import asyncio
import contextlib
import json
import secrets
import signal
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from nerfnav.core.errors import NerfnavError
from nerfnav.formats import read_camera
from nerfnav.live import CameraCheck, Navigator
from nerfnav.live.messages import Size, Welcome
from nerfnav_app.cli.terminal import note
from nerfnav_app.jobs.track.camera_check import CalibrationFile
from nerfnav_app.live_server import LiveServer
from nerfnav_app.places.place import open_place
from nerfnav_app.security.address import check_address, check_token


@dataclass(frozen=True)
class Arguments:
    """Take pictures of a vehicle's camera at a local socket; answer with its pose and next setpoints."""

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    robot: Annotated[str, arg(metavar="NAME|FILE")] = "quadrotor"
    """Robot: a name, or a file that describes it."""
    camera: Path | None = None
    """Calibration of its camera by ROS, OpenCV, Kalibr, EuRoC, nerfstudio or COLMAP (default: the robot's own)."""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """Address to listen at; the default is for this machine alone."""
    port: int = 8090
    """Port to listen at."""
    token: Annotated[str | None, arg(metavar="SECRET")] = None
    """Secret of the vehicle, as in ws://HOST:PORT/?token=SECRET (default: a new one, which is printed)."""
    obstacles: Path | None = None
    """Obstacles that stand in the place, in YAML or JSON, as with `nerfnav fly`."""
    fit_camera: Annotated[Path | None, arg(metavar="FILE.json")] = None
    """File for the calibration that fits the field best, for --camera: from the first pictures that are followed."""
    json: bool = False
    """Print one JSON object with the address; camera_check is in the answers to pictures."""


def run(arguments: Arguments) -> None:
    """Open the place, prepare what takes long, print the address, serve until Ctrl-C."""
    check_address(arguments.host, arguments.port)
    check_token(arguments.host, arguments.token)
    token = arguments.token or secrets.token_urlsafe(16)
    calibration = None if arguments.fit_camera is None else CalibrationFile(arguments.fit_camera)
    if calibration is not None:
        calibration.prepare()
    place = open_place(arguments.field, arguments.robot)
    if arguments.obstacles is not None:
        from nerfnav_app.places.obstacles import open_with_obstacles, require_standing  # slow to import, seldom needed

        require_standing(arguments.obstacles)
        place = open_with_obstacles(place, arguments.obstacles)
    camera = place.robot.camera if arguments.camera is None else read_camera(arguments.camera)
    navigator = Navigator(place.field, place.robot, camera, log=note)
    (x, y, z), (to_x, to_y, to_z) = place.field.box.lower.tolist(), place.field.box.upper.tolist()
    size, box = Size(camera.width, camera.height), ((x, y, z), (to_x, to_y, to_z))
    address = f"ws://{arguments.host}:{arguments.port}/?token={token}"

    def checked(check: CameraCheck) -> None:
        note(check.sentence if check.ok else f"{check.sentence}: give a calibration by --camera")
        if calibration is not None:
            try:
                calibration.write(navigator.camera_fit)
            except NerfnavError as error:  # the vehicle is served all the same
                note(str(error))

    server = LiveServer(navigator, Welcome(place.name, place.robot.name, size, box), arguments.host, token, checked)

    def ready() -> None:
        text = f"nerfnav guides a {place.robot.name} in {place.name} at {address} (Ctrl-C ends it)"
        sys.stdout.write((json.dumps({"address": address, "field": place.name}) if arguments.json else text) + "\n")
        sys.stdout.flush()

    with contextlib.suppress(ValueError):  # in tests this is not the main thread, which alone hears signals
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # what supervisors send ends it as Ctrl-C does
    with contextlib.suppress(KeyboardInterrupt):  # the way to end a server
        asyncio.run(server.run(arguments.port, note, ready))
