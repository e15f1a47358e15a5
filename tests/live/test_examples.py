"""The examples for real vehicles against stand-ins of ROS 2 and MAVSDK; server, field and pictures are real."""

import json
import math
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch

from nerfnav.geometry import so3
from nerfnav.live import Goal, LiveClient, Order
from tests.live.stand_ins import vehicle
from tests.waiting import free_port

ROOT, STAND_INS = Path(__file__).parents[2], Path(__file__).with_name("stand_ins")
PATIENCE_S = 400
CAMERA_INFO = """image_width: 320
image_height: 240
camera_matrix: {rows: 3, cols: 3, data: [160, 0, 160, 0, 160, 120, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a server in a process of its own, which ends without a complaint."""
    camera = tmp_path_factory.mktemp("live") / "camera.yaml"
    camera.write_text(CAMERA_INFO)
    heeds = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)"
    command = [sys.executable, "-c", f"{heeds}; from nerfnav_app.cli.main import main; sys.exit(main())", "live"]
    command += [vehicle.PLACE, "--camera", str(camera), "--port", str(port := free_port()), "--token", "T", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        told = json.loads(process.stdout.readline())
        assert told == {"address": f"ws://127.0.0.1:{port}/?token=T", "field": vehicle.PLACE}
        yield told["address"]
        process.send_signal(signal.SIGINT)
        rest, complaint = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0 and rest == "" and "Traceback" not in complaint, complaint


def ran(name: str, address: str, record: Path, *options: str) -> list[dict[str, Any]]:
    """What the vehicle has written down."""
    goal = list(map(str, vehicle.GOAL))
    command = [sys.executable, str(ROOT / "examples" / f"{name}.py"), address, "--goal", *goal, *options]
    paths = os.pathsep.join([str(STAND_INS), str(ROOT)])
    done = subprocess.run(
        command, env={**os.environ, "PYTHONPATH": paths, "STAND_IN_RECORD": str(record)}, capture_output=True,
        text=True, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    print(done.stdout)
    return [json.loads(line) for line in record.read_text().splitlines()]


@pytest.mark.slow
def test_a_vehicle_of_ros_2_is_led_to_its_goal(address: str, tmp_path: Path) -> None:
    rows = ran("ros2_node", address, tmp_path / "record.jsonl")
    known = [row for row in rows if "estimate" in row]
    assert len(known) >= 8 and len(known) == len(rows), "it is found in the first picture"
    off = np.linalg.norm([np.subtract(row["estimate"], row["truth"]) for row in known], axis=1)
    assert np.median(off) < 0.01 and off.max() < 0.04, off
    assert rows[0]["points"] == 0, "as long as its place is known to 3 cm only, it is to hold"
    assert sum(row["points"] > 1 for row in rows) >= 8 and rows[-1]["points"] == 1
    assert sum(row["points"] == 0 for row in rows) <= 4, "it may hold on the way where a picture tells too little"
    assert np.linalg.norm(np.subtract(rows[-1]["truth"], vehicle.GOAL[:3])) < 0.1


@pytest.mark.slow
def test_an_autopilot_of_px4_gets_pose_and_setpoints_in_its_own_axes(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STAND_IN_RECORD", str(tmp_path / "unused"))
    seen = vehicle.Vehicle()
    for index in range(6):  # it hovers
        assert cv2.imwrite(str(tmp_path / f"{index:03d}.png"), seen.picture()[..., ::-1])
    rows = ran("mavsdk_offboard", address, tmp_path / "record.jsonl", "--camera", str(tmp_path / "%03d.png"))
    x, y, z = vehicle.START
    estimates = [row["estimate"] for row in rows if "estimate" in row]
    assert len(estimates) == 6
    for estimate in estimates:
        at, angle = estimate["position_body"], estimate["angle_body"]
        assert (at["x_m"], at["y_m"], at["z_m"]) == pytest.approx((y, x, -z), abs=0.03)
        assert (angle["roll_rad"], angle["pitch_rad"]) == pytest.approx((0, 0), abs=0.03)
        assert math.remainder(angle["yaw_rad"] - (math.pi / 2 - vehicle.YAW), math.tau) == pytest.approx(0, abs=0.03)
    setpoints = [row["setpoint"] for row in rows if "setpoint" in row]
    modes = [row["mode"] for row in rows if "mode" in row]
    assert len(setpoints) >= 2 and modes[0] == "offboard" and set(modes) <= {"offboard", "hold"}
    for position, velocity, acceleration in setpoints:
        assert (position["north_m"], position["east_m"], position["down_m"]) == pytest.approx((y, x, -z), abs=0.25)
        assert velocity["north_m_s"] < 0.2, "the goal is to the south"
        assert set(acceleration) == {"north_m_s2", "east_m_s2", "down_m_s2"}


@pytest.mark.slow
def test_old_pictures_are_refused_and_stale_ones_planned_from_no_more(address: str, monkeypatch: Any) -> None:
    monkeypatch.setenv("STAND_IN_RECORD", "unused")
    picture, goal = vehicle.Vehicle().picture(), Goal(vehicle.GOAL[:3])
    with LiveClient(address) as live:
        found, followed = live.see(picture, 10.0, goal), live.see(picture, 10.1, goal)
        assert (found.status, followed.status) == ("found", "followed")
        assert followed.guidance is not None and followed.guidance.order is Order.FOLLOW
        covariance = torch.tensor(followed.covariance)
        assert (torch.linalg.eigvalsh(covariance) > 0).all() and covariance[0, 0].sqrt() < 0.01
        w, i, j, k = followed.quaternion or (0, 0, 0, 0)
        yaw = so3.yaw_of(so3.matrix_from_quaternion(torch.tensor([w, i, j, k])))
        assert float(yaw) == pytest.approx(vehicle.YAW, abs=0.02)
        for time in (10.1, 9.0):
            old = live.see(picture, time, goal)
            assert old.status == "old" and old.position is None and old.guidance is None and "not used" in old.sentence
        stale = live.see(picture, 10.2, goal, now=11.0)
        assert stale.status == "followed" and stale.guidance is not None and stale.guidance.order is Order.HOLD
        age = re.match(r"the picture is (\S+) s old", stale.guidance.reason)
        assert age is not None and float(age[1]) >= 0.8, "and as old as it waited on top of it"
