"""Tracker: estimate the pose of a camera from one picture after the other, without an initial pose.

    tracker = Tracker(field, camera)                  # a hand-held camera; or robot=, mount=, config=
    for frame in source.frames():
        tracked = tracker.observe(frame)              # -> TrackedFrame: status, pose, covariance 6 x 6, ms

Until the camera is found, it is searched for everywhere (estimator/relocalize/global_localization.py). From then on a
robot's dynamics or an inertial measurement unit predicts over the time since the last frame, however long
(motions.py), and a filter corrects: that of real pictures, or that of flights. A picture that fits much worse than
those before it is aligned again from around the prediction, and if it fits nowhere there, searched for everywhere.
Where no other place fits it better, the pose that shows most of it is believed; where the pose does not, no pose is
reported. Pictures in a row that contradict, or say nothing, end the track: then the search begins again.

A `Tracker` is one object for one run, with a little state: the belief and its time, the number of useless pictures in
a row, and the fit of the last pictures.
"""

import time
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import TypeGuard

import torch
from torch import Tensor

from nerfnav.core.steps import run_steps
from nerfnav.estimator import (
    AlignedFilter,
    Belief,
    ConsiderCovariance,
    FastFilter,
    FilterOutcome,
    FilterResult,
    GlobalLocalizer,
    RelocaliseOutcome,
    RelocaliseResult,
    reduce_camera,
    resize_picture,
)
from nerfnav.estimator.core.filter_step import is_usable
from nerfnav.estimator.map_error import add_consider_covariance, correct_schmidt_kalman
from nerfnav.field import Field
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose
from nerfnav.robots import HandHeld, ProcessNoise, RandomAcceleration, RigidState, Robot
from nerfnav.tracking.frame import Frame, TrackedFrame, TrackStatus
from nerfnav.tracking.motions import CarrierMotion, InertialMotion, ModelMotion
from nerfnav.tracking.photometric_consistency import PhotometricConsistency, UsualDifference
from nerfnav.tracking.tracker_config import TrackerConfig

_USED = (FilterOutcome.UPDATED, FilterOutcome.WEAK)
"""Outcomes of which the posterior is believed."""


class Tracker:
    """Tracker of one camera through one field; see above."""

    def __init__(
        self,
        field: Field,
        camera: Camera,
        robot: Robot | None = None,
        mount: Pose = FORWARD_MOUNT,
        config: TrackerConfig | None = None,
        inertial: InertialMotion | None = None,
    ) -> None:
        """Begin without a pose. `camera` may be of any resolution; `mount` is T_body_camera; default robot: HandHeld.

        An inertial measurement unit predicts instead of the robot; it is the body.
        """
        self.field, self.camera, self.mount = field, camera, mount
        self.robot = HandHeld() if robot is None else robot
        config = TrackerConfig() if config is None else config
        self.config = config.in_place(float(field.box.size.max()))
        self.motion: CarrierMotion = ModelMotion(self.robot, self.config) if inertial is None else inertial
        self._map_error = ConsiderCovariance(self.config.floor, mount)
        self._filters: dict[Camera, AlignedFilter | FastFilter] = {}
        self.forget()

    def forget(self) -> None:
        """Begin anew: another camera comes, or its clock begins anew. Panoramas and filters are kept."""
        self._belief: Belief | None = None
        self._time: float | None = None
        self._useless = 0
        self._searched: float | None = None
        self._was_known = self._doubted = False
        self._usual = UsualDifference(self.config.filter.color_noise.std, self.config.remembered)
        self._generator = torch.Generator().manual_seed(0)
        self.motion.forget()

    def with_camera(self, camera: Camera) -> "Tracker":
        """Return a tracker of another camera that has seen nothing; panoramas and the motion model are shared."""
        other = copy(self)
        other.camera, other._filters = camera, {}
        other.__dict__.pop("compared", None)
        other.__dict__["searcher"] = self.searcher.with_camera(other.compared)
        other.forget()
        return other

    @torch.no_grad()
    def observe(self, frame: Frame, action: Tensor | None = None) -> TrackedFrame:
        """Track a frame; `action` is that of the robot since the frame before (None: none of its own).

        Raises InvalidInputError for a picture of other proportions than the camera's, and for times that do not grow.
        """
        begun = time.perf_counter()
        frame.require_after(self._time)
        self._reduced(frame.picture)  # refuses other proportions
        status, difference = self._track(frame.time, frame.picture, action)
        self._time = frame.time
        self._was_known = self._was_known or status.knows
        ms = 1e3 * (time.perf_counter() - begun)
        known = self._belief if status.knows else None
        belief = None if known is None else add_consider_covariance(known, self._map_error.at(known))
        return TrackedFrame(frame.time, frame.name, status, belief, self.mount, ms, difference)

    @cached_property
    def searcher(self) -> GlobalLocalizer:
        """Global localizer; its first search takes seconds longer."""
        return GlobalLocalizer(self.field, self.compared, self.config.filter.color_noise, self.config.search)

    @cached_property
    def compared(self) -> Camera:
        """Camera at the resolution of searches and of shown pictures."""
        return reduce_camera(self.camera, self.config.longest)

    def fitted(self, picture: Tensor) -> Tensor:
        """Resize a picture of any resolution to that of `compared`."""
        return resize_picture(picture, self.compared)

    def _reduced(self, picture: Tensor) -> Camera:
        """Return the camera at the resolution of comparisons: that of smaller pictures is kept."""
        return reduce_camera(self.camera.for_picture(picture.shape[1], picture.shape[0]), self.config.longest)

    def _track(self, now: float, picture: Tensor, action: Tensor | None) -> tuple[TrackStatus, float | None]:
        """Search or follow; returns the status, and the difference of picture and field."""
        if self._belief is None:
            return self._search(now, picture)
        assert self._time is not None, "a belief has a time"
        prediction, noise = self.motion.predict(self._belief, (self._time, now), action)
        result, fit = self._correct(prediction, picture, noise)
        if not self._fits(fit, result) and self.config.align is not None:
            around = Belief(prediction.mean, prediction.covariance + self.config.around.covariance())
            again, nearer = self._correct(around, picture, noise, self.config.starts)
            if self._fits(nearer, again):
                result, fit, prediction = again, nearer, around
        contradicts = self._contradicts(fit, result)
        used = result.outcome in _USED and not contradicts
        self._belief = result.posterior if used else prediction
        if used:
            self.motion.corrected(prediction, result.posterior)
        if self._fits(fit, result):
            self._usual.add(fit.difference)
            return self._follow(fit)
        if fit is not None and (used or contradicts):
            return self._check_elsewhere(now, picture, fit, contradicts)
        return self._skip(now, picture, None if fit is None else fit.difference)

    def _correct(
        self, prediction: Belief, picture: Tensor, noise: ProcessNoise, starts: int = 1
    ) -> tuple[FilterResult, PhotometricConsistency | None]:
        """Correct a prediction by a picture (Schmidt-Kalman); returns also how well picture and field agree then."""
        map_error, camera = self._map_error.at(prediction), self._reduced(picture)
        small, seen = resize_picture(picture, camera), add_consider_covariance(prediction, map_error)
        filter_ = self._filter(camera)
        if isinstance(filter_, AlignedFilter):
            update = filter_.correct(seen, small, self._generator, noise, starts)
        else:
            update = filter_.correct(seen, small, self._generator, noise)
        found = run_steps(update)
        used = found.outcome in _USED
        posterior = correct_schmidt_kalman(found.posterior, prediction, map_error, noise) if used else prediction
        return replace(found, posterior=posterior), PhotometricConsistency.of(found.step, small)

    def _filter(self, camera: Camera) -> AlignedFilter | FastFilter:
        """Return the filter for a resolution of the camera, made once."""
        if camera not in self._filters:
            config = self.config
            self._filters[camera] = (
                FastFilter(self.field, self.robot, camera, self.mount, config.filter)
                if config.align is None
                else AlignedFilter(self.field, camera, self.mount, config.filter, config.align)
            )
        return self._filters[camera]

    def _fits(self, fit: PhotometricConsistency | None, result: FilterResult) -> TypeGuard[PhotometricConsistency]:
        """Return True for a picture that looks as much like the field as those before it did."""
        usual = self.config.suspicious * self._usual.difference
        return result.outcome in _USED and fit is not None and fit.difference <= usual

    def _contradicts(self, fit: PhotometricConsistency | None, result: FilterResult) -> bool:
        """Return True for a picture that was not taken anywhere around."""
        if self.config.align is None or fit is None or self._fits(fit, result):
            return False
        return fit.unexplained > self.config.unexplained

    def _follow(self, fit: PhotometricConsistency) -> tuple[TrackStatus, float]:
        """Go on with the belief."""
        status = TrackStatus.FOUND_AGAIN if self._doubted else TrackStatus.FOLLOWED
        self._useless, self._doubted = 0, False
        return status, fit.difference

    def _skip(self, now: float, picture: Tensor, difference: float | None) -> tuple[TrackStatus, float | None]:
        """Go on for a while after a useless picture, then search; a belief that a picture contradicted is not reported
        meanwhile."""
        if not self._give_up_in_time():
            return TrackStatus.LOST if self._doubted else TrackStatus.PREDICTED, difference
        return self._search(now, picture)

    def _check_elsewhere(
        self, now: float, picture: Tensor, fit: PhotometricConsistency, contradicts: bool
    ) -> tuple[TrackStatus, float | None]:
        """Search for a picture that fits badly: the track goes on where no other place fits it better.

        Where it contradicts, the belief is kept for the pictures that follow, and not reported.
        """
        before, found = (self._belief, self._useless, self._doubted), self._look_everywhere(now, picture)
        better = fit.difference / self.config.better
        if found is not None and found.outcome is RelocaliseOutcome.FOUND:
            status, difference = self._begin(found, picture)
            if difference is not None and difference < better:
                return status, difference
        self._belief, self._useless, self._doubted = before
        if contradicts:
            self._doubted = True
            self._give_up_in_time()
            return TrackStatus.LOST, fit.difference
        if found is None:
            return self._follow(fit)
        if found.outcome is not RelocaliseOutcome.FOUND and found.step.differences[0] < better:
            return self._skip(now, picture, fit.difference)
        self._usual.restart(fit.difference)
        return self._follow(fit)

    def _give_up_in_time(self) -> bool:
        """Count a useless picture; end the track, and return True, after too many in a row."""
        self._useless += 1
        wide = self._belief is None or not self._belief.position_std < self.config.widest
        if self._useless < self.config.patience and not wide:
            return False
        self._belief, self._useless, self._doubted = None, 0, False
        return True

    def _search(self, now: float, picture: Tensor) -> tuple[TrackStatus, float | None]:
        """Look everywhere, and begin a track at the place that is found."""
        found = self._look_everywhere(now, picture)
        if found is None or found.outcome is not RelocaliseOutcome.FOUND:
            return self._missing, None
        return self._begin(found, picture)

    @property
    def _missing(self) -> TrackStatus:
        return TrackStatus.LOST if self._was_known else TrackStatus.SEARCHING

    def _look_everywhere(self, now: float, picture: Tensor) -> RelocaliseResult | None:
        """Run a search; None where the picture shows nothing, or the last search was just now."""
        soon = self._searched is not None and now - self._searched < self.config.between
        if soon or not is_usable(picture, self.config.filter.least_contrast):
            return None
        self._searched = now
        return run_steps(self.searcher.relocalise(self.fitted(picture)))

    def _begin(self, found: RelocaliseResult, picture: Tensor) -> tuple[TrackStatus, float | None]:
        """Believe the likeliest place unless the picture contradicts it; returns the difference to the field there."""
        pose, still = found.step.body_poses(self.mount)[0], torch.zeros(3)
        state = RigidState(pose.position, still, pose.rotation, still)
        self._belief, difference = Belief(state, self.config.found.covariance()), float(found.step.differences[0])
        self._useless, self._doubted = 0, False
        if self.config.align is not None:
            result, fit = self._correct(self._belief, picture, RandomAcceleration(0.0, 0.0, 0.0))
            if self._contradicts(fit, result):
                self._belief = None
                return self._missing, None
            if result.outcome in _USED and fit is not None:
                self._belief, difference = result.posterior, fit.difference
        return TrackStatus.FOUND_AGAIN if self._was_known else TrackStatus.FOUND, difference
