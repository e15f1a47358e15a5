"""Time the opening of a file in this process: the part of app/benchmarks/opening.py that runs in the new process.

What plans and flies is imported once the source is shown, as in the page, where it stands in other jobs.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav_app.jobs.events import JobEvent, SurfaceShaped
from nerfnav_app.jobs.open import make_field
from nerfnav_app.places.sources import USUAL

if TYPE_CHECKING:
    from nerfnav.field import VoxelField
    from nerfnav_app.jobs.plan.plan import PlanRequest
    from nerfnav_app.places.ends import Ends
    from nerfnav_app.places.place import Place

_FLIGHTS = 3
"""Flights in each field, one for each seed: the 95th percentiles of two flights alone differ by up to a factor of two.
"""


def time_opening(source: Path, out: Path, began: float, seconds: float) -> dict[str, Any]:
    """Open a file or a capture, plan, fly by camera, and train the field for so many seconds [s], where it is a draft.

    `began` is the time.time() that all times count from. `shown`: a mesh, or the surface of a field, is ready for the
    viewer; `planned`: there is a plan to fly; `flown`: a flight has arrived; `full`: the field is trained. None where
    that did not come about. `cpu_s` holds the processor time of the process by then: other processes do not add to it.
    Position errors are of all flights, outcomes of the first. `made_by` is the origin of the first field, which is left
    in `out`. Raises NerfnavError for what cannot be opened.
    """
    times: dict[str, float | None] = dict.fromkeys(("shown", "planned", "flown", "full"))
    worked: dict[str, float] = {}

    def note(name: str) -> None:
        times[name] = round(time.time() - began, 2)
        worked[name] = round(time.process_time(), 2)

    place = _make_place(source, out, lambda: note("shown"))
    from nerfnav.navigation import EpisodeOutcome
    from nerfnav_app.jobs.export.surface import build_first_surface
    from nerfnav_app.jobs.plan import plan

    made_by = place.field.info.made_by
    if times["shown"] is None:
        build_first_surface(place)
        note("shown")
    request = plan.PlanRequest(_first_ends(place), shortest=True)
    outcome_planned = run_steps(plan.run(request, place)).summary["outcome"]
    if outcome_planned in _flown_outcomes():
        note("planned")
    stages = _stages(place, source, seconds)
    if place.scene is not None:  # calibrated
        place = _better(place, stages)
    flown, errors = _fly(request, place)
    if flown["outcome"] == EpisodeOutcome.REACHED.name.lower():
        note("flown")
    better = _better(place, stages)
    note("full")
    flown_on, errors_on = _fly(request, better)
    errors += _errors_of_more_flights(request, place)
    errors_on += _errors_of_more_flights(request, better)
    return times | {
        "made_by": made_by,
        "cpu_s": worked,
        "psnr_db": better.field.info.psnr_db,
        "outcome_planned": outcome_planned,
        "outcome": flown["outcome"],
        "position_p95_m": _p95(errors),
        "outcome_full": flown_on["outcome"],
        "position_p95_full_m": _p95(errors_on),
    }


def _flown_outcomes() -> set[str]:
    """Outcomes of plans that are flown, those among them of which the user is asked first: their risk is high."""
    from nerfnav.planner import FLYABLE, PlanOutcome

    return {outcome.name.lower() for outcome in (*FLYABLE, PlanOutcome.LIKELY_COLLISION)}


def _make_place(source: Path, out: Path, on_shown: Callable[[], None]) -> "Place":
    """Make the field of a source, as the page does."""
    for event in make_field.run(source, out):
        if isinstance(event, SurfaceShaped):
            on_shown()
    from nerfnav_app.places.place import open_place

    return open_place(str(out))


def _first_ends(place: "Place") -> "Ends":
    """Ends as the page proposes them. Raises InvalidInputError without room."""
    from nerfnav.field import UnknownSpace
    from nerfnav.planner import OccupancyConfig
    from nerfnav.planner.objective.default_ends import propose_ends
    from nerfnav_app.places.derived import build_occupancy, prepare_place
    from nerfnav_app.places.ends import End, Ends

    seen = prepare_place(place, UnknownSpace.OCCUPIED)
    found = propose_ends(
        seen.field, place.field, place.robot, lambda height: build_occupancy(seen, OccupancyConfig(), height)
    )
    if found is None:
        raise InvalidInputError(f"there is no room for a {place.robot.name} in {place.name}")
    return Ends(*map(End.of_state, found))


def _stages(place: "Place", source: Path, seconds: float) -> "Iterator[JobEvent | VoxelField]":
    """Better fields of the place, if there are any: of a mesh two, of a capture one."""
    from nerfnav.field import VoxelField
    from nerfnav_app.jobs.field import baked, drafts

    assert place.file is not None, "it was opened from a file"
    if place.scene is not None and isinstance(place.field, VoxelField):
        return baked.refine(place.field, place.scene, place.file, seconds)
    return drafts.refine(source, place.file, USUAL, seconds) if place.field.info.is_draft else iter(())


def _better(place: "Place", stages: "Iterator[JobEvent | VoxelField]") -> "Place":
    """The place with its next better field, or as it is where there is none."""
    from nerfnav.field import VoxelField

    return replace(place, field=next((step for step in stages if isinstance(step, VoxelField)), place.field))


def _errors_of_more_flights(request: "PlanRequest", place: "Place") -> list[float]:
    """Fly the request with further seeds; the position errors of all time steps [m]."""
    return [error for seed in range(1, _FLIGHTS) for error in _fly(request, place, seed)[1]]


def _p95(errors: list[float]) -> float | None:
    """95th percentile; None of nothing."""
    return float(np.quantile(errors, 0.95)) if errors else None


def _fly(request: "PlanRequest", place: "Place", seed: int = 0) -> tuple[dict[str, Any], list[float]]:
    """Fly the request; numbers of the flight, and its position errors by time step [m]."""
    from nerfnav.navigation import NavigationStep
    from nerfnav_app.jobs.fly import fly
    from nerfnav_app.jobs.fly.request import FlyRequest

    steps, errors = fly.run(FlyRequest(request, seed=seed), place), []
    while True:
        try:
            event = next(steps)
        except StopIteration as end:
            return end.value.summary, errors
        if isinstance(event, NavigationStep):
            errors.append(float((event.belief.mean.position - event.truth.position).norm()))
