"""Tracker: estimate the pose of a camera from one picture after the other, without an initial pose.

    tracker = Tracker(field, camera)                  # a hand-held camera; or robot=, mount=, config=
    for frame in source.frames():
        tracked = tracker.observe(frame)              # -> Tracked: status, pose, covariance 6 x 6, ms

Until the camera is known a search looks everywhere (estimator/relocalize/global_localization.py). From then on a
robot's dynamics or an inertial measurement unit predicts over the time since the last frame, however long
(motions.py), and a filter corrects: that of real pictures, or that of flights (`correction`). A picture that fits
much worse than those before it is looked for around the prediction, and if it fits nowhere there, everywhere. Where
no other place fits it better, the pose that shows most of it is believed; where the pose does not, no pose is
reported. Pictures in a row that contradict, or say nothing, end the track: then the search begins again.

A `Tracker` is one object for one run, with a little state: the belief and its time, how many pictures in a row were
of no use, and how well pictures fitted so far.
"""


import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TypeGuard

import torch
from torch import Tensor

from nerfnav.estimator import (
    AlignedFilter,
    Belief,
    ConsiderCovariance,
    FastFilter,
    FilterOutcome,
    FilterStep,
    GlobalLocalizer,
    RelocaliseOutcome,
    RelocaliseStep,
    reduce_camera,
    resize_picture,
)
from nerfnav.estimator.core.filter_step import measure_contrast
from nerfnav.estimator.schmidt_kalman import add_consider_covariance, correct_schmidt_kalman
from nerfnav.field import Field
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose
from nerfnav.robots import HandHeld, ProcessNoise, RandomAcceleration, RigidState, Robot
from nerfnav.tracking.frame import Frame
from nerfnav.tracking.motions import CarrierMotion, InertialMotion, ModelMotion
from nerfnav.tracking.photometric_consistency import PhotometricConsistency, UsualDifference
from nerfnav.tracking.tracked_frame import TrackedFrame, TrackStatus
from nerfnav.tracking.tracker_config import TrackerConfig

Correction = Callable[[Belief, Tensor, torch.Generator, ProcessNoise, int], FilterStep]
"""The last step of an update: from a prediction, a picture, random draws, the process noise that is in the prediction,
and from how many starts (which the filter of flights decides by itself)."""


def correction(field: Field, robot: Robot, camera: Camera, mount: Pose, config: TrackerConfig) -> Correction:
    """As `config` says."""
    if config.align is not None:
        return AlignedFilter(field, camera, mount, config.filter, config.align).correct
    fast = FastFilter(field, robot, camera, mount, config.filter)

    def last_step(
        prediction: Belief, picture: Tensor, generator: torch.Generator, noise: ProcessNoise, _starts: int
    ) -> FilterStep:
        return deque(fast.correct(prediction, picture, generator, noise), maxlen=1).pop()

    return last_step


_USED = (FilterOutcome.UPDATED, FilterOutcome.WEAK)
"""Outcomes of which the posterior is believed."""


class Tracker:
    """Follows one camera through one field; see above."""

    def __init__(
        self,
        field: Field,
        camera: Camera,
        robot: Robot | None = None,
        mount: Pose = FORWARD_MOUNT,
        config: TrackerConfig | None = None,
        inertial: InertialMotion | None = None,
    ) -> None:
        """Know nothing. `camera` may be of any resolution; `mount` is T_body_camera; default robot: HandHeld.

        With an inertial measurement unit that one leads from picture to picture, and not the robot; it is the body.
        """
        self.field, self.camera, self.mount = field, camera, mount
        self.robot = HandHeld() if robot is None else robot
        config = TrackerConfig() if config is None else config
        self.config = config.in_place(float(field.box.size.max()))
        self.motion: CarrierMotion = ModelMotion(self.robot, self.config) if inertial is None else inertial
        self._lasting = ConsiderCovariance(self.config.floor, mount)
        self._corrections: dict[Camera, Correction] = {}
        self.forget()

    def forget(self) -> None:
        """Know nothing again: another camera comes, or its clock begins anew. What took long to make is kept."""
        self._belief: Belief | None = None
        self._time: float | None = None
        self._useless = 0
        self._searched: float | None = None
        self._was_known = self._doubted = False
        self._usual = UsualDifference(self.config.filter.color_noise.std, self.config.remembered)
        self._generator = torch.Generator().manual_seed(0)
        self.motion.forget()

    @torch.no_grad()
    def observe(self, frame: Frame, action: Tensor | None = None) -> TrackedFrame:
        """What a frame tells; `action` is what the robot did since the one before (None: it did nothing of its own).

        Raises InvalidInputError for a picture of other proportions than the camera's, and for times that do not grow.
        """
        begun = time.perf_counter()
        frame.require_after(self._time)
        self._comparable(frame.picture)  # refuses other proportions
        status, difference = self._status(frame.time, frame.picture, action)
        self._time = frame.time
        self._was_known = self._was_known or status.knows
        ms = 1e3 * (time.perf_counter() - begun)
        known = self._belief if status.knows else None
        belief = None if known is None else add_consider_covariance(known, self._lasting.at(known))
        return TrackedFrame(frame.time, frame.name, status, belief, self.mount, ms, difference)

    @cached_property
    def searcher(self) -> GlobalLocalizer:
        """Finds the camera in the field from nothing; its first search takes seconds longer."""
        return GlobalLocalizer(self.field, self.compared, self.config.filter.color_noise, self.config.search)

    def _comparable(self, picture: Tensor) -> Camera:
        """The camera at the resolution that a picture is compared at: smaller ones are compared as they are."""
        return reduce_camera(self.camera.for_picture(picture.shape[1], picture.shape[0]), self.config.longest)

    def _correction(self, camera: Camera) -> Correction:
        if camera not in self._corrections:
            self._corrections[camera] = correction(self.field, self.robot, camera, self.mount, self.config)
        return self._corrections[camera]

    @cached_property
    def compared(self) -> Camera:
        """The camera at the resolution that pictures are looked for and shown at."""
        return reduce_camera(self.camera, self.config.longest)

    def fitted(self, picture: Tensor) -> Tensor:
        """A picture of any resolution with the pixels of `compared`."""
        return resize_picture(picture, self.compared)

    def _status(self, now: float, picture: Tensor, action: Tensor | None) -> tuple[TrackStatus, float | None]:
        """Search or follow; the status, and how far picture and field differ."""
        if self._belief is None:
            return self._search(now, picture)
        prediction, noise = self._predicted(self._belief, now, action)
        step, likeness = self._correct(prediction, picture, noise)
        if not self._fits(likeness, step) and self.config.align is not None:
            around = self._around(prediction)
            again, nearer = self._correct(around, picture, noise, self.config.starts)
            if self._fits(nearer, again):
                step, likeness, prediction = again, nearer, around
        contradicts = self._contradicts(likeness, step)
        used = step.outcome in _USED and not contradicts
        self._belief = step.posterior if used else prediction
        if used and step.posterior is not None:
            self.motion.corrected(prediction, step.posterior)
        if self._fits(likeness, step):
            self._usual.add(likeness.difference)
            return self._followed(likeness)
        if likeness is not None and (used or contradicts):
            return self._looked_for(now, picture, likeness, contradicts)
        return self._of_no_use(now, picture, None if likeness is None else likeness.difference)

    def _fits(self, likeness: PhotometricConsistency | None, step: FilterStep) -> TypeGuard[PhotometricConsistency]:
        """Whether a picture looks as much like the field as those before it did."""
        usual = self.config.suspicious * self._usual.difference
        return step.outcome in _USED and likeness is not None and likeness.difference <= usual

    def _contradicts(self, likeness: PhotometricConsistency | None, step: FilterStep) -> bool:
        """Whether a picture was not taken anywhere around."""
        if self.config.align is None or likeness is None or self._fits(likeness, step):
            return False
        return likeness.unexplained > self.config.unexplained

    def _followed(self, likeness: PhotometricConsistency) -> tuple[TrackStatus, float]:
        status = TrackStatus.FOUND_AGAIN if self._doubted else TrackStatus.FOLLOWED
        self._useless, self._doubted = 0, False
        return status, likeness.difference

    def _of_no_use(self, now: float, picture: Tensor, difference: float | None) -> tuple[TrackStatus, float | None]:
        """After a picture that cannot be used: go on for a while, then search."""
        if not self._give_up_in_time():
            return TrackStatus.PREDICTED, difference
        return self._search(now, picture)

    def _looked_for(
        self, now: float, picture: Tensor, likeness: PhotometricConsistency, contradicts: bool
    ) -> tuple[TrackStatus, float | None]:
        """What a picture that fits badly comes to: the track goes on where no other place fits it better.

        Where it contradicts, the belief is kept for the pictures that follow, and not told.
        """
        before, step = (self._belief, self._useless, self._doubted), self._look_everywhere(now, picture)
        better = likeness.difference / self.config.better
        if step is not None and step.outcome is RelocaliseOutcome.FOUND:
            status, found = self._found(step, picture)
            if found is not None and found < better:
                return status, found
        self._belief, self._useless, self._doubted = before
        if contradicts:
            self._doubted = True
            self._give_up_in_time()
            return TrackStatus.LOST, likeness.difference
        if step is not None and step.outcome is not RelocaliseOutcome.FOUND and step.differences[0] < better:
            return self._of_no_use(now, picture, likeness.difference)
        if step is not None:
            self._usual.begin_anew(likeness.difference)
        return self._followed(likeness)

    def _give_up_in_time(self) -> bool:
        """After a picture that cannot be used: end the track where that happened too often in a row."""
        assert self._belief is not None, "there is a track to end"
        self._useless += 1
        if self._useless < self.config.patience and self._belief.spread < self.config.widest:
            return False
        self._belief, self._useless, self._doubted = None, 0, False
        return True

    def _predicted(self, belief: Belief, now: float, action: Tensor | None) -> tuple[Belief, ProcessNoise]:
        """The belief at a time, and the process noise that is in it."""
        assert self._time is not None, "what is believed was believed at some time"
        return self.motion.predict(belief, (self._time, now), action)

    def _correct(
        self, prediction: Belief, picture: Tensor, noise: ProcessNoise, starts: int = 1
    ) -> tuple[FilterStep, PhotometricConsistency | None]:
        """What a picture makes of a prediction, and how much it looks like the field then."""
        floor, camera = self._lasting.at(prediction), self._comparable(picture)
        small = resize_picture(picture, camera)
        step = self._correction(camera)(
            add_consider_covariance(prediction, floor), small, self._generator, noise, starts
        )
        assert step.posterior is not None, "an update has its posterior"
        used = step.outcome in _USED
        posterior = correct_schmidt_kalman(step.posterior, prediction, floor, noise) if used else prediction
        return replace(step, posterior=posterior), PhotometricConsistency.of(step, small)

    def _around(self, prediction: Belief) -> Belief:
        """The same, hardly sure of where the camera is."""
        return Belief(prediction.mean, prediction.covariance + self.config.around.covariance())

    def _search(self, now: float, picture: Tensor) -> tuple[TrackStatus, float | None]:
        """Look everywhere, and begin a track where that is told."""
        step = self._look_everywhere(now, picture)
        if step is None or step.outcome is not RelocaliseOutcome.FOUND:
            return self._missing, None
        return self._found(step, picture)

    @property
    def _missing(self) -> TrackStatus:
        return TrackStatus.LOST if self._was_known else TrackStatus.SEARCHING

    def _look_everywhere(self, now: float, picture: Tensor) -> RelocaliseStep | None:
        """What comes of it; None where the picture shows nothing, or the last search was just now."""
        soon = self._searched is not None and now - self._searched < self.config.between
        if soon or measure_contrast(picture) < self.config.filter.least_contrast:
            return None
        self._searched = now
        return deque(self.searcher.relocalise(self.fitted(picture)), maxlen=1).pop()

    def _found(self, step: RelocaliseStep, picture: Tensor) -> tuple[TrackStatus, float | None]:
        """Believe the likeliest place unless the picture contradicts it; how far picture and field differ there."""
        pose, still = step.body_poses(self.mount)[0], torch.zeros(3)
        state = RigidState(pose.position, still, pose.rotation, still)
        self._belief, told = Belief(state, self.config.found.covariance()), float(step.differences[0])
        self._useless, self._doubted = 0, False
        if self.config.align is not None:
            fit, likeness = self._correct(self._belief, picture, RandomAcceleration(0.0, 0.0, 0.0))
            if self._contradicts(likeness, fit):
                self._belief = None
                return self._missing, None
            if fit.outcome in _USED and likeness is not None:
                self._belief, told = fit.posterior, likeness.difference
        return TrackStatus.FOUND_AGAIN if self._was_known else TrackStatus.FOUND, told
