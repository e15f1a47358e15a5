"""Seen movers: the chain of boxes holds the thing at all times, and what was seen through or forgotten is free."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.navigation.seen_movers import SeenConfig, SeenMovers, fit_chain
from nerfnav.navigation.watch import Region

LEAST, STEP = 0.15, 0.05
UP = np.array([0.0, 0.0, 1.0])


def region(time: float, camera: np.ndarray, thing: np.ndarray, size: float, rays: int = 20) -> Region:
    """What a camera sees of a ball."""
    away = thing - camera
    distance = float(np.linalg.norm(away))
    ahead = away / distance
    across = np.cross(ahead, UP) / np.linalg.norm(np.cross(ahead, UP))
    looks = size / distance
    return Region(time, camera, ahead, across, np.cross(across, ahead), looks, looks, False, 4.0, STEP, rays)


def holds(seen: SeenMovers, place: np.ndarray, time: float) -> bool:
    return seen.movers is not None and any(
        box.signed_distance(place[None], time)[0] <= 0 for box in seen.movers.obstacles
    )


@pytest.mark.parametrize("seed", range(8))
def test_the_chain_holds_the_thing_in_each_picture_and_soon_after(seed: int) -> None:
    draws = np.random.default_rng(seed)
    velocity = np.append(draws.uniform(-0.8, 0.8, 2), 0.0)
    start, camera, speed = np.array([1.8, 0.3, 0.5]), np.array([0.0, 0.0, 0.5]), draws.uniform(-0.5, 0.5, 3)
    size, seen = draws.uniform(0.2, 0.5), SeenMovers(least=LEAST)
    for index in range(8):
        time = 0.1 * index
        place = start + time * velocity
        seen = seen.after((region(time, camera, place, size),), None, time)
        assert len(seen.things) == 1 and holds(seen, place, time)
        for later in (0.1, 0.2):
            assert holds(seen, place + later * velocity, time + later)
        camera = camera + 0.1 * speed + draws.normal(0, 0.02, 3)  # a robot that is pushed


def test_a_robot_that_manoeuvres_learns_the_distance() -> None:
    thing, regions = np.array([1.5, 0.0, 0.5]), list[Region]()
    for index, y in enumerate((0.0, 0.2, 0.3, 0.2, 0.0, -0.2, -0.3)):
        regions.append(region(0.1 * index, np.array([0.0, y, 0.5]), thing, 0.3))
    first, last = (fit_chain(tuple(some), LEAST, SeenConfig()) for some in (regions[:1], regions))
    assert len(last.sizes) < len(first.sizes) and (np.abs(np.log(last.sizes / 0.3)) < np.log(1.5)).all()
    assert np.abs(np.linalg.norm(last.velocities, axis=1)).max() < 0.8


def test_a_robot_at_constant_velocity_cannot_tell_distances() -> None:
    regions = [region(t, np.array([0.0, t, 0.5]), np.array([2.0 - t, 0.5, 0.5]), 0.3) for t in (0.0, 0.1, 0.2, 0.3)]
    assert len(fit_chain(tuple(regions), LEAST, SeenConfig()).sizes) > 3


def test_a_small_region_counts_when_it_is_seen_twice() -> None:
    small = region(0.0, np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.2, rays=5)
    once = SeenMovers(least=LEAST).after((small,), None, 0.0)
    assert once.movers is None and once.after((replace(small, time=0.1),), None, 0.1).movers is not None
    assert once.after((), None, 0.1).things == (), "else it was none"


def test_what_left_the_view_goes_on_and_is_forgotten() -> None:
    seen, config = SeenMovers(least=LEAST), SeenConfig()
    velocity, start = np.array([0.0, 0.6, 0.0]), np.array([1.5, 0.0, 0.5])
    for time in (0.0, 0.1, 0.2, 0.3):
        seen = seen.after((region(time, np.array([0.0, 0.0, 0.5]), start + time * velocity, 0.3),), None, time)
    gone = seen.after((), None, 0.6)
    assert holds(gone, start + 0.6 * velocity, 0.6)
    assert gone.after((), None, 0.3 + config.forget_s + 0.1).movers is None


def test_a_robot_that_has_waited_does_not_hurry() -> None:
    path = torch.tensor([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    seen = SeenMovers(pace=1.0)
    assert seen.steps_at_pace(path, 0.1) == int(np.ceil(20 / seen.config.hurry))
    assert SeenMovers().steps_at_pace(path, 0.1) == 0
