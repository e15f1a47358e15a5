"""A tracker: where a camera is, from one picture after the other, when nothing was known at first.

    tracker = Tracker(field, camera)                  # a hand-held camera; or robot=, mount=, config=
    for frame in source.frames():
        tracked = tracker.observe(frame)              # -> Tracked: status, pose, covariance 6 x 6, ms

Until the camera is known a search looks everywhere (estimator/relocalise.py). From then on the motion model predicts
over the time since the last frame, however long, and the fast filter corrects (estimator/fast.py). Pictures in a row
that disagree, or say nothing, end the track, and so does a picture that fits much worse than those before it did where
a search finds a place that fits better: then the search begins again.

A `Tracker` is one object for one run, with a little state: the belief and its time, how many pictures in a row were
of no use, and how well pictures fitted so far.
"""

import time
from collections import deque
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.estimator import (
    Belief,
    FastFilter,
    FilterOutcome,
    FilterStep,
    RandomAcceleration,
    RelocaliseOutcome,
    RelocaliseStep,
    Searcher,
    comparable,
)
from nerfnav.estimator.covariance import POSE
from nerfnav.estimator.predict import predict
from nerfnav.estimator.verdict import contrast
from nerfnav.field import Field
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, reduced
from nerfnav.robots import POSITION, HandHeld, RigidState, Robot
from nerfnav.tracking.frame import Frame
from nerfnav.tracking.status import TrackStatus
from nerfnav.tracking.tracked import Tracked
from nerfnav.tracking.tracker_config import TrackerConfig

_SATURATION = 0.3
"""Colour differences above this count as this where pictures are judged [1 = full scale]."""


class Tracker:
    """Follows one camera through one field; see above."""

    def __init__(
        self,
        field: Field,
        camera: Camera,
        robot: Robot | None = None,
        mount: Pose = FORWARD_MOUNT,
        config: TrackerConfig | None = None,
    ) -> None:
        """Know nothing. `camera` may be of any resolution; `mount` is T_body_camera; default robot: HandHeld."""
        self.field, self.camera, self.mount = field, camera, mount
        self.robot = HandHeld() if robot is None else robot
        self.config = TrackerConfig() if config is None else config
        self._filters: dict[Camera, FastFilter] = {}
        self.forget()

    def forget(self) -> None:
        """Know nothing again: another camera comes, or its clock begins anew. What took long to make is kept."""
        self._belief: Belief | None = None
        self._time: float | None = None
        self._useless = 0
        self._searched: float | None = None
        self._was_known = False
        self._usual: deque[float] = deque(maxlen=self.config.remembered)
        self._generator = torch.Generator().manual_seed(0)

    @torch.no_grad()
    def observe(self, frame: Frame, action: Tensor | None = None) -> Tracked:
        """What a frame tells; `action` is what the robot did since the one before (None: it did nothing of its own).

        Raises InvalidInputError for a picture of other proportions than the camera's, and for times that do not grow.
        """
        begun = time.perf_counter()
        self._check(frame)
        status, difference = self._status(frame.time, frame.picture, action)
        self._time = frame.time
        self._was_known = self._was_known or status.knows
        ms = 1e3 * (time.perf_counter() - begun)
        return Tracked(frame.time, frame.name, status, self._belief, self.mount, ms, difference)

    @cached_property
    def searcher(self) -> Searcher:
        """Finds the camera in the field from nothing; its first search takes seconds longer."""
        return Searcher(self.field, self.compared, self.config.filter.color_noise, self.config.search)

    def _filter_of(self, picture: Tensor) -> FastFilter:
        """For pictures of this resolution: smaller ones are compared as they are."""
        height, width = picture.shape[:2]
        camera = comparable(self.camera.for_picture(width, height), self.config.longest)
        if camera not in self._filters:
            self._filters[camera] = FastFilter(self.field, self.robot, camera, self.mount, self.config.filter)
        return self._filters[camera]

    @cached_property
    def compared(self) -> Camera:
        """The camera at the resolution that pictures are looked for and shown at."""
        return comparable(self.camera, self.config.longest)

    @cached_property
    def _floor(self) -> Float[Tensor, "6 6"]:
        """Of position in the camera's axes and attitude in the body's tangent."""
        if not self.config.floor:
            return torch.zeros(6, 6)
        turn = torch.block_diag(torch.eye(3), self.mount.rotation)
        return turn @ torch.tensor(self.config.floor).reshape(6, 6) @ turn.T

    def _check(self, frame: Frame) -> None:
        if self._time is not None and not frame.time > self._time:
            raise InvalidInputError(
                f"{frame.name} was taken at {frame.time:g} s, not after the frame before it ({self._time:g} s): "
                "frames come in the order of their times"
            )
        height, width = frame.picture.shape[:2]
        self.camera.for_picture(width, height)  # refuses other proportions

    def fitted(self, picture: Tensor) -> Tensor:
        """A picture of any resolution with the pixels of `compared`."""
        return _resized(picture, self.compared)

    def _status(self, now: float, picture: Tensor, action: Tensor | None) -> tuple[TrackStatus, float | None]:
        """Search or follow; the status, and how far picture and field differ."""
        if self._belief is None:
            return self._search(now, picture)
        step = self._correct(self._belief, now, picture, action)
        assert step.posterior is not None, "the last step of an update has its posterior"
        self._belief, difference = step.posterior, _difference(step)
        if step.outcome in (FilterOutcome.UPDATED, FilterOutcome.WEAK) and difference is not None:
            self._belief = self._with_floor(step.posterior)
            if difference > self.config.suspicious * self._usually:
                return self._looked_for(now, picture, difference)
            return self._followed(difference)
        return self._of_no_use(now, picture, difference)

    def _followed(self, difference: float) -> tuple[TrackStatus, float]:
        self._useless = 0
        self._usual.append(difference)
        return TrackStatus.FOLLOWED, difference

    def _of_no_use(self, now: float, picture: Tensor, difference: float | None) -> tuple[TrackStatus, float | None]:
        """After a picture that cannot be used: go on for a while, then search."""
        self._useless += 1
        if self._useless < self.config.patience and self._spread() < self.config.widest:
            return TrackStatus.PREDICTED, difference
        self._belief, self._useless = None, 0
        return self._search(now, picture)

    @property
    def _usually(self) -> float:
        """How far pictures differ where the pose is right: no more than held-out photographs did."""
        told = self.config.filter.color_noise.std
        return min(told, float(np.median(self._usual))) if self._usual else told

    def _looked_for(self, now: float, picture: Tensor, difference: float) -> tuple[TrackStatus, float | None]:
        """What a picture that fits badly comes to: the track goes on where no other place fits it better."""
        before, self._belief = self._belief, None
        status, found = self._search(now, picture)
        if found is not None and found < difference / self.config.better:
            self._useless = 0
            return status, found
        self._belief = before
        return self._of_no_use(now, picture, difference) if found is None else self._followed(difference)

    def _correct(self, belief: Belief, now: float, picture: Tensor, action: Tensor | None) -> FilterStep:
        """The belief at the time of a picture, with what that shows."""
        assert self._time is not None, "what is believed was believed at some time"
        config, dt = self.config, now - self._time
        noise = RandomAcceleration(dt, config.linear, config.angular)
        action = self.robot.hold(belief.mean, dt) if action is None else action
        prediction = predict(belief, action, self.robot, dt, noise)
        fast = self._filter_of(picture)
        steps = fast.correct(prediction, _resized(picture, fast.camera), self._generator, noise)
        return deque(steps, maxlen=1).pop()

    def _with_floor(self, belief: Belief) -> Belief:
        """The belief with what does not average out, which a picture cannot tell."""
        turn = torch.block_diag(belief.mean.pose.compose(self.mount).rotation, torch.eye(3))
        covariance = belief.covariance.clone()
        pose = torch.tensor(POSE)
        covariance[pose[:, None], pose] += turn @ self._floor @ turn.T
        return Belief(belief.mean, covariance)

    def _search(self, now: float, picture: Tensor) -> tuple[TrackStatus, float | None]:
        """Look everywhere, unless the picture shows nothing, or the last search was just now."""
        missing = TrackStatus.LOST if self._was_known else TrackStatus.SEARCHING
        soon = self._searched is not None and now - self._searched < self.config.between
        if soon or contrast(picture) < self.config.filter.least_contrast:
            return missing, None
        self._searched = now
        step: RelocaliseStep = deque(self.searcher.relocalise(self.fitted(picture)), maxlen=1).pop()
        if step.outcome is not RelocaliseOutcome.FOUND:
            return missing, None
        pose, still = step.body_poses(self.mount)[0], torch.zeros(3)
        state = RigidState(pose.position, still, pose.rotation, still)
        self._belief = Belief(state, self.config.found.covariance())
        return TrackStatus.FOUND_AGAIN if self._was_known else TrackStatus.FOUND, float(step.differences[0])

    def _spread(self) -> float:
        """Largest standard deviation of a coordinate of the position [m]."""
        assert self._belief is not None
        return float(self._belief.covariance.diagonal()[POSITION].max().sqrt())


def _resized(picture: Tensor, camera: Camera) -> Tensor:
    """A picture with the pixels of another resolution of its camera."""
    if tuple(picture.shape[:2]) == (camera.height, camera.width):
        return picture
    return (255 * reduced(picture, camera)).round().to(torch.uint8).reshape(camera.height, camera.width, 3)


def _difference(step: FilterStep) -> float | None:
    """Robust root mean square of the pixels' differences; None where none were compared."""
    return float(step.residual.clamp_max(_SATURATION).square().mean().sqrt()) if len(step.residual) else None
