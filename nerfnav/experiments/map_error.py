"""Error of the map: measure the position error of the filter in flight beyond what each picture alone explains."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import FilterConfig, FilterOutcome, fit_position_bias
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.closed_loop_flight import FlightTrial, fly_steps
from nerfnav.robots import POSITION

FLIGHTS = 60
"""Flights that give the floor to a tenth or so."""
_FIRST_SEED = 500_000
"""Seed of the flights, apart from those of experiments."""
_FEWEST = 30
"""Fewest pictures that give an estimate."""


def position_floor(arena: Arena, flights: int = FLIGHTS) -> float:
    """f of estimator/map_error.py [m], from flights of the quadrotor between random ends in the paper's noise.

    Raises InvalidInputError where too few of their pictures show enough.
    """
    found = [*_found(_count_pictures_in_full(arena), flights)]
    if len(found) < _FEWEST:
        raise InvalidInputError(f"{len(found)} pictures of {flights} flights give a position: {_FEWEST} are needed")
    errors, covariances = (np.stack(part) for part in zip(*found, strict=True))
    return fit_position_bias(errors, covariances)


def _count_pictures_in_full(arena: Arena) -> Arena:
    """Return the arena with pictures that count in full where the field was never calibrated: covariances widened by
    `FastConfig.uncalibrated` would explain the map error too.
    """
    info = arena.field.info
    if info.information_ratio is not None:
        return arena
    return replace(arena, field=replace(arena.field, info=replace(info, information_ratio=1.0)))


def _found(arena: Arena, flights: int) -> Iterator[tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]]:
    """Position errors [m] and covariances without the floor that the flights assume [m^2]."""
    assumed = FilterConfig().for_field(arena.field.info).floor_at(arena.field.resolution).position_m
    for seed in range(_FIRST_SEED, _FIRST_SEED + flights):
        for step in fly_steps(arena, FlightTrial(None, seed, robot="quadrotor")):
            # of a picture that says little, little is believed, with any floor
            if step.update is not None and step.update.outcome is FilterOutcome.UPDATED:
                posterior = step.update.posterior
                said = posterior.covariance[POSITION, POSITION].double().numpy()
                yield posterior.mean.local(step.truth)[POSITION].double().numpy(), said - assumed**2 * np.eye(3)
