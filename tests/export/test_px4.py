"""Setpoints in the autopilot's axes."""

import csv
import io
import math

import numpy as np
import torch

from nerfnav.export.px4 import COLUMNS, ned_of_enu, px4, yaw_ned_of_enu
from tests.export.flights import DT, plan


def rows_of(content: bytes) -> dict[str, np.ndarray]:
    """The columns of a file."""
    head, *rows = csv.reader(io.StringIO(content.decode()))
    assert tuple(head) == COLUMNS
    return dict(zip(head, np.array(rows, dtype=np.float64).T, strict=True))


def test_east_becomes_y_north_becomes_x_and_up_becomes_minus_z() -> None:
    np.testing.assert_array_equal(ned_of_enu(torch.tensor([1.0, 2.0, 3.0])), [2.0, 1.0, -3.0])


def test_headings_count_clockwise_from_north_and_stay_within_half_a_turn() -> None:
    yaw = torch.tensor([0.0, math.pi / 2, math.pi, -math.pi / 2, 20.0], dtype=torch.float64)
    turned = yaw_ned_of_enu(yaw)
    np.testing.assert_allclose(turned[:4], [math.pi / 2, 0.0, -math.pi / 2, math.pi], atol=1e-12)
    assert (turned > -math.pi).all() and (turned <= math.pi).all()
    torch.testing.assert_close(torch.cos(yaw_ned_of_enu(turned) - yaw), torch.ones(5, dtype=torch.float64))


def test_setpoints_read_back_as_the_states() -> None:
    recording = plan()
    rows = rows_of(px4(recording).content)
    back = ned_of_enu(torch.tensor(np.stack([rows["x"], rows["y"], rows["z"]], -1)))
    np.testing.assert_allclose(back, recording.position, atol=1e-6)
    back = ned_of_enu(torch.tensor(np.stack([rows["vx"], rows["vy"], rows["vz"]], -1)))
    np.testing.assert_allclose(back, recording.velocity, atol=1e-6)
    heading = recording.yaw() - yaw_ned_of_enu(torch.tensor(rows["yaw"]))
    np.testing.assert_allclose(torch.cos(heading), 1.0, atol=1e-6)
    np.testing.assert_allclose(rows["t"], recording.times, atol=1e-6)


def test_an_acceleration_held_for_its_step_leads_to_the_next_velocity() -> None:
    rows = rows_of(px4(plan()).content)
    for axis in "xyz":
        np.testing.assert_allclose(rows[f"v{axis}"][:-1] + DT * rows[f"a{axis}"][:-1], rows[f"v{axis}"][1:], atol=1e-6)


def test_a_heading_that_passes_half_a_turn_does_not_jump() -> None:
    assert plan(30).yaw().diff().abs().max() < 0.2
