"""Curves for vehicles are judged on the field that they were planned in, not only the plans that they were made of."""

from dataclasses import replace

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.export.curve_safety import motion_along
from nerfnav.export.curves import curve_of
from nerfnav.export.formats import FORMATS
from nerfnav.field.models.analytic import BallsField
from nerfnav.geometry.box import Box
from nerfnav.robots.quadrotor import Quadrotor
from tests.export.flights import hover_to_hover

ZURICH = (47.3977, 8.5456, 488.0)
ROOM = Box.of((-2, -2, -1), (3, 3, 3))
MOVING = [name for name, form in FORMATS.items() if form.moves_vehicle]


def ball_at(point: list[float], radius: float) -> BallsField:
    return BallsField(ROOM, torch.tensor([point]), torch.tensor([radius]))


NOWHERE = ball_at([-1.5, -1.5, -0.5], 0.1)
"""Far from the way."""


def test_the_curve_is_judged_as_the_states_of_a_quadrotor_that_flies_it() -> None:
    recording = hover_to_hover()
    shape = curve_of(recording).shape
    motion = motion_along(shape, Quadrotor())
    times = motion.dt * torch.arange(motion.states.position.shape[0], dtype=torch.float64)
    assert float(times[-1]) == pytest.approx(float(shape.times[-1]))
    torch.testing.assert_close(motion.states.position, shape(times)[:, :3].float())
    pull = shape(times, 2)[:, :3] + torch.tensor([0.0, 0.0, 9.81])
    up = torch.nn.functional.normalize(pull, dim=-1).float()
    torch.testing.assert_close(motion.states.rotation[..., 2], up, atol=1e-3, rtol=0)
    turned = motion.states.rotation[:-1] @ torch.linalg.matrix_exp(
        motion.dt * torch.stack([_cross(rate) for rate in motion.states.body_rate[:-1]])
    )
    torch.testing.assert_close(turned, motion.states.rotation[1:], atol=1e-4, rtol=0)


def _cross(rate: torch.Tensor) -> torch.Tensor:
    x, y, z = rate.tolist()
    return torch.tensor([[0, -z, y], [z, 0, -x], [-y, x, 0]])


@pytest.mark.parametrize("name", MOVING)
def test_a_curve_that_meets_something_solid_leaves_only_by_force(name: str) -> None:
    recording = replace(hover_to_hover(), datum=ZURICH)
    middle = recording.position[len(recording.times) // 2].tolist()
    free, blocked = (recording.with_field(field) for field in (NOWHERE, ball_at(middle, 0.1)))
    reported = FORMATS[name].exported(free).info["curve"]
    assert reported["outcome"] == "converged" and reported["collision_probability_bound"] < 0.01
    with pytest.raises(InvalidInputError, match=r"the plan is not exported for \w+: its smooth curve cuts.*--force"):
        FORMATS[name].exported(blocked)
    assert FORMATS[name].exported(blocked, force=True).info["curve"]["outcome"] == "in_collision"


def test_where_no_field_is_known_nothing_is_said_of_the_curve_and_it_is_reported_so() -> None:
    assert FORMATS["px4"].exported(hover_to_hover()).info["curve"] is None


def test_a_table_is_no_vehicles_curve() -> None:
    assert "curve" not in FORMATS["csv"].exported(hover_to_hover().with_field(NOWHERE)).info
