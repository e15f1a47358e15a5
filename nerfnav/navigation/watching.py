"""Watching: what in a picture is not the field, for the filter before its correction and for the planner after it."""

import math
from dataclasses import dataclass, replace

from jaxtyping import Bool
from torch import Tensor

from nerfnav.estimator import Belief, Predictor
from nerfnav.estimator.core.prediction import predict
from nerfnav.navigation.episode import NavigationStep
from nerfnav.navigation.flight import FlightContext
from nerfnav.navigation.seen_movers import SeenMovers
from nerfnav.navigation.watch import ExpectedPicture
from nerfnav.robots import Motion

_LEAST = 1.5
"""Least size of what moves, in lengths of the robot."""


@dataclass(frozen=True)
class Foresight:
    """Knowledge of a picture before the filter's correction."""

    announced: Bool[Tensor, "height width"] | None
    """Pixels that announced movers cover; None: none does."""
    hidden: Bool[Tensor, "height width"] | None
    """Pixels that do not show the field; None: none is known."""
    expected: ExpectedPicture | None
    """The field's picture from the predicted pose; None where the robot does not watch."""


def foresee_picture(image: Tensor | None, belief: Belief, time: float, flight: FlightContext) -> Foresight:
    """Compare a picture of a time of the flight [s] with the field, by a predicted belief; find what movers hide."""
    stack, announced = flight.stack, None
    if image is None:
        return Foresight(None, None, None)
    if stack.hidden is not None:
        announced = stack.hidden(belief.mean.pose.compose(flight.simulator.mount), time)
    if stack.watch is None:
        return Foresight(announced, announced, None)
    expected = stack.watch.expect(belief)
    differs = expected.hidden(image, announced) if stack.watch.masks else None
    if announced is not None and differs is not None:
        return Foresight(announced, announced | differs, expected)
    return Foresight(announced, differs if announced is None else announced, expected)


def foresee_after(last: NavigationStep, image: Tensor | None, flight: FlightContext) -> Foresight:
    """Foresee the picture after the first action of the last plan."""
    action, dt, robot = last.plan.actions[0], flight.request.dt, flight.simulator.robot
    if image is None or (flight.stack.hidden is None and flight.stack.watch is None):
        return Foresight(None, None, None)
    estimator = flight.stack.estimator
    if isinstance(estimator, Predictor):  # which may know more than the dynamics, as with gyroscopes
        belief, _ = estimator.predict(last.filter_belief, action, dt)
    else:
        belief = predict(last.filter_belief, action, robot, dt, flight.config.filter.process_noise)
    return foresee_picture(image, belief, last.time + dt, flight)


def find_movers(
    step: NavigationStep, before: SeenMovers | None, view: Foresight, flight: FlightContext
) -> SeenMovers | None:
    """Find what the picture of a time step shows and the field does not, by the corrected belief; None where the robot
    does not watch."""
    if flight.stack.watch is None:
        return None
    known = before or _nothing_seen(step.plan, flight)
    if view.expected is None or step.image is None:
        return known.after((), None, step.time)
    regions, seen = view.expected.regions(step.image, step.filter_belief, step.time, view.announced)
    return known.after(regions, seen, step.time)


def _nothing_seen(first: Motion, flight: FlightContext) -> SeenMovers:
    moves = first.states.position.diff(dim=0).norm(dim=-1).sum().item()
    pace = moves / (first.dt * len(first.actions)) if len(first.actions) else 0.0
    return SeenMovers(least=_LEAST * max(flight.simulator.robot.body.extents), pace=pace or math.inf)


def among_seen(step: NavigationStep, flight: FlightContext) -> FlightContext:
    """Return the flight with a planner and a safety filter that keep clear of what was seen."""
    stack = flight.stack.among(step.seen)
    return flight if stack is flight.stack else replace(flight, stack=stack)
