"""Trajectories survive the way into a file and back."""

import io
import json
import math
from typing import Any

import numpy as np
import pandas
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator.core.belief import Belief
from nerfnav.export.tables import (
    FRAMES,
    STATE_COLUMNS,
    csv_text,
    episode_table,
    json_text,
    motion_table,
    table_of_json,
)
from nerfnav.geometry import so3
from nerfnav.navigation.episode import Episode, EpisodeOutcome
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.state import Motion, RigidState
from tests.export.readers import motion_of_table, table_of_csv

NAMES = Quadrotor.action_names


@pytest.fixture
def motion() -> Motion:
    """Seven states that turn once around the vertical axis, with random actions."""
    generator = torch.Generator().manual_seed(1)
    yaw = torch.linspace(0, 2 * torch.pi, 7)
    states = RigidState(
        torch.randn(7, 3, generator=generator),
        torch.randn(7, 3, generator=generator),
        so3.from_yaw(yaw),
        torch.randn(7, 3, generator=generator),
    )
    return Motion(states, torch.randn(6, 4, generator=generator), 0.1)


def test_a_table_has_a_row_for_each_state_and_names_the_actions_with_their_units(motion: Motion) -> None:
    table = motion_table(motion, NAMES, "quadrotor")
    assert table.columns == ("t", *STATE_COLUMNS, "thrust_n", "torque_x_nm", "torque_y_nm", "torque_z_nm")
    assert table.values.shape == (7, 18)
    assert torch.allclose(table.column("t"), 0.1 * torch.arange(7, dtype=torch.float64))
    assert torch.equal(table.block(("vx", "vy", "vz")).float(), motion.states.velocity)
    assert torch.equal(table.column("thrust_n")[:-1].float(), motion.actions[:, 0])


def test_the_last_row_has_no_action(motion: Motion) -> None:
    table = motion_table(motion, NAMES)
    assert table.block(NAMES)[-1].isnan().all()
    assert csv_text(table).splitlines()[-1].endswith(",,,,")
    assert json.loads(json_text(table))["rows"][-1][-4:] == [None] * 4


def test_a_flight_that_never_began_has_one_row(motion: Motion) -> None:
    table = motion_table(Motion(motion.states[:1], motion.actions[:0], motion.dt), NAMES)
    assert table.values.shape == (1, 18) and table.block(("qw", "qx", "qy", "qz")).norm() == pytest.approx(1)


def test_quaternions_do_not_jump_between_rows(motion: Motion) -> None:
    quaternions = motion_table(motion, NAMES).block(("qw", "qx", "qy", "qz"))
    assert (quaternions.diff(dim=0).norm(dim=-1) < 0.6).all()
    assert torch.allclose(so3.matrix_from_quaternion(quaternions).float(), motion.states.rotation, atol=1e-6)


def test_csv_gives_back_every_bit_of_the_numbers(motion: Motion) -> None:
    table = motion_table(motion, NAMES)
    read = table_of_csv(csv_text(table))
    assert read.columns == table.columns
    assert torch.equal(read.block(("x", "y", "z")).float(), motion.states.position)
    assert torch.equal(read.block(NAMES)[:-1].float(), motion.actions)


def test_json_gives_back_the_motion(motion: Motion) -> None:
    read = table_of_json(json_text(motion_table(motion, NAMES, "quadrotor")))
    assert read.info == {"robot": "quadrotor", "dt": 0.1, "actions": list(NAMES)}
    back = motion_of_table(read)
    assert back.dt == motion.dt
    assert torch.equal(back.actions, motion.actions)
    assert torch.equal(back.states.position, motion.states.position)
    assert torch.equal(back.states.body_rate, motion.states.body_rate)
    assert torch.allclose(back.states.rotation, motion.states.rotation, atol=1e-6)


def test_pandas_reads_the_units_and_what_holds_until_the_next_row(motion: Motion) -> None:
    read = pandas.read_csv(io.StringIO(csv_text(motion_table(motion, NAMES))))
    assert list(read.columns[:5]) == ["t [s]", "x [m]", "y [m]", "z [m]", "vx [m/s until the next row]"]
    assert "qw" in read.columns and "thrust_n [N until the next row]" in read.columns
    np.testing.assert_array_equal(read["x [m]"].to_numpy(np.float32), motion.states.position[:, 0])
    assert "v_k" in json.loads(json_text(motion_table(motion, NAMES)))["held"]["velocity"]


def test_json_says_what_its_numbers_mean(motion: Motion) -> None:
    content = json.loads(json_text(motion_table(motion, NAMES, "quadrotor")))
    assert content["frames"] == FRAMES
    assert set(content["units"]) == set(content["columns"])
    assert content["units"]["x"] == "m"
    assert content["units"]["wz"] == "rad/s"
    assert content["units"]["thrust_n"] == "N"
    assert content["units"]["torque_x_nm"] == "N m"


def test_actions_that_do_not_belong_to_the_robot_are_refused(motion: Motion) -> None:
    with pytest.raises(InvalidInputError, match=r"actions of shape \(6, 2\), not \(6, 4\)"):
        motion_table(motion, ("speed_mps", "turn_radps"))


@pytest.mark.parametrize("text", ["", "t,x\n", "t,x\n1,hello\n", "t,x\n1,2\n3\n"])
def test_what_is_no_table_is_not_read_as_csv(text: str) -> None:
    with pytest.raises(InvalidInputError, match="not a CSV table"):
        table_of_csv(text)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "other", "version": 1}', '{"format": "nerfnav'])
def test_what_is_no_trajectory_is_not_read_as_json(text: str) -> None:
    with pytest.raises(InvalidInputError, match="no nerfnav trajectory"):
        table_of_json(text)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda said: said["rows"][2].__setitem__(7, math.inf), r"qw in rows\[2\] is inf"),
        (lambda said: said["rows"][2].__setitem__(1, math.nan), r"x in rows\[2\] is nan"),
        (lambda said: said["rows"][2].__setitem__(1, -1e30), r"x in rows\[2\] is -1e\+30"),
        (lambda said: said["rows"][2].__setitem__(1, None), r"x in rows\[2\] is None"),
        (lambda said: said["rows"][2].__setitem__(1, "1"), r"got `str` - at `\$\.rows\[2\]\[1\]`"),
        (lambda said: said["rows"][2].pop(), r"rows\[2\] has 17 numbers for 18 columns"),
        (lambda said: said["rows"][2].__setitem__(0, 9.0), r"t in rows\[3\] is 0\.3"),
        (lambda said: said["rows"][2].__setitem__(slice(7, 11), [0, 0, 0, 0]), r"rows\[2\] are no unit quaternion"),
        (lambda said: said.__setitem__("dt", 0), "dt is a number"),
        (lambda said: said.__setitem__("rows", []), "0 rows"),
        (lambda said: said.__setitem__("actions", "thrust"), r"\$\.actions"),
        (lambda said: said["columns"].__setitem__(1, "east"), "its columns lack x"),
    ],
)
def test_what_is_no_motion_is_refused_with_its_place(change: Any, reason: str, motion: Motion) -> None:
    said = json.loads(json_text(motion_table(motion, NAMES, "quadrotor")))
    change(said)
    with pytest.raises(InvalidInputError, match=reason):
        table_of_json(json.dumps(said))


def test_a_table_without_its_dt_makes_no_motion(motion: Motion) -> None:
    with pytest.raises(InvalidInputError, match="the names of the actions or dt"):
        motion_of_table(table_of_csv(csv_text(motion_table(motion, NAMES))))


def test_an_empty_cell_is_not_a_number() -> None:
    assert math.isnan(table_of_csv("a,b\n1,\n").values[0, 1].item())


def test_a_flight_has_the_belief_beside_the_truth(motion: Motion) -> None:
    generator = torch.Generator().manual_seed(2)
    mean = motion.states.retract(0.01 * torch.randn(7, 12, generator=generator))
    beliefs = Belief(mean, torch.diag(torch.linspace(0.01, 0.12, 12)).expand(7, 12, 12))
    touched = torch.tensor([False, False, True, False, False, False, False])
    spent = torch.zeros(7)
    episode = Episode(
        motion.states, beliefs, motion.actions, (motion,) * 7, touched, spent, spent, 0.1, EpisodeOutcome.COLLIDED
    )
    table = table_of_json(json_text(episode_table(episode, NAMES, "quadrotor")))
    assert table.info["outcome"] == "collided"
    assert torch.equal(table.block(("x", "y", "z")).float(), motion.states.position)
    assert torch.equal(table.block(("belief_x", "belief_y", "belief_z")).float(), mean.position)
    assert table.column("sd_y")[3].item() == pytest.approx(0.02**0.5)
    assert table.column("touched").tolist() == [0, 0, 1, 0, 0, 0, 0]
    assert torch.equal(motion_of_table(table).actions, motion.actions)
