"""Messages for PX4 and ArduPilot, read by pandas."""

import io
import math

import numpy as np
import pandas
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.export.autopilots import (
    ARDUPILOT_COLUMNS,
    ODOMETRY_COLUMNS,
    SETPOINT_COLUMNS,
    ardupilot,
    px4,
    px4_odometry,
)
from nerfnav.export.recording import Recording
from nerfnav.export.setpoints import cell_of, ned_of_enu, yaw_ned_of_enu
from nerfnav.geometry import so3
from nerfnav.robots.quadrotor import Quadrotor
from tests.export.flights import flight, flown, hover_to_hover, plan


def read(content: bytes) -> pandas.DataFrame:
    """A file as pandas reads it, past the line that says what it is."""
    return pandas.read_csv(io.BytesIO(content), comment="#")


def vectors(rows: pandas.DataFrame, name: str, size: int = 3) -> np.ndarray:
    return rows[[f"{name}[{index}]" for index in range(size)]].to_numpy()


def test_east_becomes_y_north_becomes_x_and_up_becomes_minus_z() -> None:
    np.testing.assert_array_equal(ned_of_enu(torch.tensor([1.0, 2.0, 3.0])), [2.0, 1.0, -3.0])


def test_headings_count_clockwise_from_north_and_stay_within_half_a_turn() -> None:
    yaw = torch.tensor([0.0, math.pi / 2, math.pi, -math.pi / 2, 20.0], dtype=torch.float64)
    turned = yaw_ned_of_enu(yaw)
    np.testing.assert_allclose(turned[:4], [math.pi / 2, 0.0, -math.pi / 2, math.pi], atol=1e-12)
    assert (turned > -math.pi).all() and (turned <= math.pi).all()
    torch.testing.assert_close(torch.cos(yaw_ned_of_enu(turned) - yaw), torch.ones(5, dtype=torch.float64))


def test_the_columns_are_the_fields_of_the_message_and_its_version_is_said() -> None:
    content = px4(hover_to_hover()).content
    rows = read(content)
    assert tuple(rows.columns) == SETPOINT_COLUMNS and SETPOINT_COLUMNS[1:4] == tuple(f"position[{i}]" for i in "012")
    first = content.decode().splitlines()[0]
    assert "px4_msgs/msg/TrajectorySetpoint" in first and "MESSAGE_VERSION 0" in first and "outcome: converged" in first
    assert rows["timestamp"].dtype.kind == "i" and set(np.diff(rows["timestamp"])) == {20_000}


@pytest.mark.parametrize("recording", [hover_to_hover(), flight()])
def test_each_row_is_kinematically_consistent_with_its_neighbours(recording: Recording) -> None:
    rows = read(px4(recording).content)[:-1]  # the last row may come sooner after the one before
    step = 1e-6 * np.diff(rows["timestamp"])[0]
    p, v, a = (vectors(rows, name) for name in ("position", "velocity", "acceleration"))
    moved = step * (v[1:] + v[:-1]) / 2 - step**2 * np.diff(a, axis=0) / 12  # of a cubic velocity: exact
    np.testing.assert_allclose(np.diff(p, axis=0), moved, atol=2e-6)
    gained = step * (a[1:] + a[:-1]) / 2
    np.testing.assert_allclose(np.diff(v, axis=0), gained, atol=0.02)
    turned = np.diff(np.unwrap(rows["yaw"])) / step
    middle = (rows["yawspeed"].to_numpy()[1:] + rows["yawspeed"].to_numpy()[:-1]) / 2
    np.testing.assert_allclose(turned, middle, atol=0.1)


def test_rows_of_the_plan_have_its_central_differences() -> None:
    recording = hover_to_hover()
    rows, p, step = read(px4(recording).content), ned_of_enu(recording.position).numpy(), recording.times[1].item()
    at = [int(np.argmin(np.abs(rows["timestamp"] - round(1e6 * time)))) for time in recording.times.tolist()][1:-1]
    acceleration = (p[2:] - 2 * p[1:-1] + p[:-2]) / step**2
    np.testing.assert_allclose(vectors(rows, "velocity")[at], (p[2:] - p[:-2]) / (2 * step), atol=1e-6)
    np.testing.assert_allclose(vectors(rows, "acceleration")[at], acceleration, atol=1e-5)
    np.testing.assert_allclose(vectors(rows, "position")[at], p[1:-1] + acceleration * step**2 / 6, atol=1e-6)


def test_a_plan_begins_and_ends_where_it_should_at_rest_and_unaccelerated() -> None:
    recording = hover_to_hover()
    rows = read(px4(recording).content)
    ends = ned_of_enu(recording.position[[0, -1]])
    np.testing.assert_allclose(vectors(rows, "position")[[0, -1]], ends, atol=1e-6)
    for name in ("velocity", "acceleration"):
        np.testing.assert_allclose(vectors(rows, name)[[0, -1]], 0, atol=1e-6)
    assert rows["timestamp"].iloc[-1] == round(1e6 * (recording.times[-1] + recording.times[1]).item())


def test_what_a_setpoint_asks_is_never_more_than_what_the_plan_asks() -> None:
    recording = hover_to_hover()
    reported, velocity = px4(recording).info, recording.velocity
    pull = velocity.diff(dim=0) / recording.times[1] + torch.tensor([0, 0, Quadrotor().config.gravity])
    assert reported["max_thrust_n"] <= Quadrotor().config.mass * pull.norm(dim=-1).max() + 1e-6
    assert reported["max_speed_mps"] <= velocity.norm(dim=-1).max() + 1e-6
    assert np.cos(np.radians(reported["max_tilt_deg"])) >= (pull[:, 2] / pull.norm(dim=-1)).min() - 1e-6


def test_no_zero_has_a_sign() -> None:
    assert [cell_of(value) for value in (-0.0, -1e-12, 0.0, 2.0, -0.5)] == ["0", "0", "0", "2", "-0.5"]
    for content in (px4(hover_to_hover()).content, ardupilot(flight()).content):
        assert "-0" not in [cell for line in content.decode().splitlines() for cell in line.split(",")]


def test_a_flight_is_smoothed_and_says_so() -> None:
    made = px4(flight())
    assert made.info["motion"] in made.content.decode().splitlines()[0]
    assert made.info["motion"] == "the flown path, smoothed" and "collided" in made.content.decode().splitlines()[0]


def test_a_heading_that_passes_half_a_turn_does_not_jump() -> None:
    assert plan(30).yaw().diff().abs().max() < 0.2


def test_ardupilot_gets_every_field_that_its_type_mask_asks_for() -> None:
    made, setpoints = ardupilot(hover_to_hover()), read(px4(hover_to_hover()).content)
    rows = read(made.content)
    assert tuple(rows.columns) == ARDUPILOT_COLUMNS
    assert set(rows["type_mask"]) == {2048} and set(rows["coordinate_frame"]) == {1}
    np.testing.assert_allclose(rows[["x", "y", "z"]], vectors(setpoints, "position"), atol=1e-9)
    np.testing.assert_allclose(rows[["afx", "afy", "afz"]], vectors(setpoints, "acceleration"), atol=1e-9)
    assert set(np.diff(rows["time_boot_ms"])) == {20}
    first = made.content.decode().splitlines()[0]
    assert "type_mask 2048" in first and "50 Hz" in first and "origin of the estimator" in first


def test_odometry_is_the_belief_in_ned_with_the_body_in_frd() -> None:
    content = px4_odometry(flight()).content
    rows = read(content)
    assert tuple(rows.columns) == ODOMETRY_COLUMNS and set(rows["pose_frame"]) == {1}
    for (_, row), step in zip(rows.iterrows(), flown(), strict=True):
        mean = step.belief.mean
        assert row["timestamp"] == row["timestamp_sample"] == round(1e6 * step.time)
        x, y, z = mean.position.tolist()
        np.testing.assert_allclose([row[f"position[{i}]"] for i in range(3)], [y, x, -z], atol=1e-6)
        q = torch.tensor([row[f"q[{i}]"] for i in range(4)], dtype=torch.float64)
        forward, left, up = mean.rotation.double().T
        turned = so3.matrix_from_quaternion(q).T  # its rows are forward, right and down, in NED
        for axis, seen in zip((forward, -left, -up), turned, strict=True):
            np.testing.assert_allclose(seen, ned_of_enu(axis), atol=1e-6)
        p, r, yaw_rate = mean.body_rate.tolist()
        np.testing.assert_allclose([row[f"angular_velocity[{i}]"] for i in range(3)], [p, -r, -yaw_rate], atol=1e-6)
        variance = step.belief.covariance.diagonal().tolist()
        np.testing.assert_allclose(
            [row[f"position_variance[{i}]"] for i in range(3)], [variance[1], variance[0], variance[2]], atol=1e-8
        )
    assert "vehicle_visual_odometry" in content.decode().splitlines()[0]


def test_a_plan_has_no_odometry() -> None:
    with pytest.raises(InvalidInputError, match="no estimate"):
        px4_odometry(plan())
