"""The pose filter under trial, made once in each process."""

from functools import lru_cache

from nerfnav import robots
from nerfnav.estimator import FastFilter, FilterConfig
from nerfnav.experiments.arena import Arena
from nerfnav.robots import CAMERA


@lru_cache(maxsize=2)
def fast_filter(arena: Arena) -> FastFilter:
    """The quadrotor's filter for the arena's field, made once in each process."""
    config = FilterConfig().for_field(arena.field.info)
    return FastFilter(arena.field, robots.load("quadrotor"), CAMERA, config=config)
