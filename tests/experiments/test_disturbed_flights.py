"""Flights that pose filters are tried on."""

import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments.disturbed_flights import Trial, fly_disturbed
from nerfnav.world.contact import contact_check
from nerfnav.world.task import Task
from tests.experiments.places import PAST, column

AWAY = Task("Out of the box, with the back to the column", (0.6, 0.0, 0.5), (0.85, 0.0, 0.5), 0.0, 0.0)


@pytest.mark.slow
def test_flights_touch_nothing_and_always_see_something() -> None:
    arena = column()
    actions, states = fly_disturbed(arena, Trial(PAST, 3))
    assert actions.shape == (20, 4) and states.position.shape == (21, 3)
    touches = contact_check(arena.scene, robots.load("quadrotor").body)
    assert not any(touches(states[index], states[index + 1]) for index in range(20))
    again, other = (fly_disturbed(arena, Trial(PAST, seed))[1] for seed in (3, 4))
    assert torch.equal(states.position, again.position) and not torch.equal(states.position, other.position)


def test_a_flight_that_sees_nothing_is_none_to_estimate_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nerfnav.experiments.disturbed_flights._REDRAWS", 5)
    with pytest.raises(InvalidInputError, match="lose sight of everything: estimate on another task"):
        fly_disturbed(column(), Trial(AWAY, 0))
