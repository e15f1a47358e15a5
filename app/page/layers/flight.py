"""The flight: where the robot is, where it believes to be, how sure it is, and what it intends."""

import numpy as np
import torch
import viser
import viser.transforms as tf

from app.page.layers.nodes import Bodies, Fan, Line, Trail, positions, quaternions
from app.page.layers.shapes import ball, robot_shape
from app.page.theme import BELIEF, HIT, PLAN, TRUTH
from app.state.session import Session
from nerfnav.estimator import Belief
from nerfnav.geometry import ellipsoid_95
from nerfnav.robots import ATTITUDE, POSITION, RigidState, Robot

_NOSE, _RIM = 0.2, 12  # length [m] and number of the lines that show where the nose may point
_PAST = 5  # earlier plans that are still drawn
_LEAST_AXIS = 1e-4  # [m]: a flat ellipsoid has no rotation


class FlightLayer:
    """Shows true path, estimated path with its covariances, and the plan of the moment."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._truth = Line(server, "/flight/truth", TRUTH, 0.016)
        self._belief = Line(server, "/flight/belief", BELIEF, 0.004)
        self._plan = Line(server, "/flight/plan", PLAN, 0.013)
        self._past = Trail(server, "/flight/plans", PLAN, 0.006)
        unit = ball()
        self._covariance = Bodies(server, "/flight/covariance", unit, BELIEF, opacity=0.3)
        self._means = Bodies(server, "/flight/means", unit, BELIEF, opacity=None)
        self._nose = Fan(server, "/flight/attitude", BELIEF, 0.004)
        self._hits = Bodies(server, "/flight/hits", unit, HIT, opacity=0.9)
        shape = robot_shape((0.1, 0.1, 0.04))
        self._robot = Bodies(server, "/flight/robot", shape, TRUTH, opacity=None)
        self._ghost = Bodies(server, "/flight/ghost", shape, BELIEF, opacity=0.5)
        self._shaped: Robot | None = None
        self._shown: tuple[int, float] | None = None

    def show(self, session: Session) -> None:
        """Draw the flight as far as it has gone."""
        flight, scale = session.shown_flight, session.view_settings.ellipsoid
        if self._shown == (id(flight), scale):
            return
        self._shown = id(flight), scale
        if session.place is not None and self._shaped is not session.place.robot:
            self._shaped = session.place.robot
            for bodies in (self._robot, self._ghost):
                bodies.shape(robot_shape(self._shaped.body.extents))
        steps = flight.steps if flight is not None else ()
        under_way = flight is not None and bool(steps) and flight.outcome is None
        with self._server.atomic():
            self._truth.show(_path([step.truth for step in steps]))
            self._belief.show(_path([step.belief.mean for step in steps]))
            intent = flight.plan if flight is not None and under_way else None
            self._plan.show(None if intent is None else positions(intent.states))
            self._past.show(tuple(step.plan for step in steps[-1 - _PAST : -1]) if under_way else ())
            self._covariance.show(*ellipsoids([step.belief for step in steps], scale))
            self._nose.show(cone(steps[-1].belief, scale) if steps else None)
            # dots, for a good estimate's line lies within the line of the truth
            self._means.show(*_balls([step.belief.mean for step in steps], radius=0.014))
            self._hits.show(*_balls([step.truth for step in steps if step.touched], radius=0.025))
            self._robot.show(*_placed(steps[-1].truth if steps else None))
            guess = flight.guess if flight is not None else None
            self._ghost.show(*_placed(guess or (steps[-1].belief.mean if steps else None)))


def ellipsoids(beliefs: list[Belief], scale: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (n, 3) [m], attitudes (n, 4) and half axes (n, 3) [m] of the 95 % ellipsoids of the positions.

    `scale` makes them larger than that, for the eye.
    """
    if not beliefs:
        return np.zeros((0, 3)), np.zeros((0, 4)), np.zeros((0, 3))
    centers = np.stack([belief.mean.position.detach().numpy() for belief in beliefs])
    axes, half = ellipsoid_95(torch.stack([belief.covariance[POSITION, POSITION] for belief in beliefs]))
    return centers, tf.SO3.from_matrix(axes.numpy()).wxyz, np.maximum(scale * half.numpy(), _LEAST_AXIS)


def cone(belief: Belief, scale: float = 1.0) -> np.ndarray:
    """Segments (n, 2, 3) [m] from the believed position to where its nose may point, on the rim of the 95 % region."""
    axes, lengths = ellipsoid_95(belief.covariance[ATTITUDE, ATTITUDE])
    half = scale * (axes * lengths).numpy()
    angles = np.linspace(0, 2 * np.pi, _RIM, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], -1)
    rim = np.concatenate([circle @ half[:, pair].T for pair in ([0, 1], [1, 2], [0, 2])])
    turned = belief.mean.rotation.double().numpy() @ tf.SO3.exp(rim).as_matrix()
    start = belief.mean.position.detach().double().numpy()
    return np.stack([np.broadcast_to(start, (len(turned), 3)), start + _NOSE * turned[:, :, 0]], 1)


def _path(states: list[RigidState]) -> np.ndarray | None:
    return positions(RigidState.stack(states)) if len(states) > 1 else None


def _balls(states: list[RigidState], radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if not states:
        return np.zeros((0, 3)), np.zeros((0, 4)), np.zeros((0, 3))
    centers = positions(RigidState.stack(states))
    return centers, np.tile([1.0, 0, 0, 0], (len(centers), 1)), np.full_like(centers, radius)


def _placed(state: RigidState | None) -> tuple[np.ndarray, np.ndarray]:
    if state is None:
        return np.zeros((0, 3)), np.zeros((0, 4))
    one = RigidState.stack([state])
    return positions(one), quaternions(one)
