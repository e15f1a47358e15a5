"""Navigator: pictures and their times in, the vehicle's pose and the next setpoints of its plan out.

    navigator = Navigator(field, robot, camera)
    navigator.prepare()                                       # seconds, once
    answer = navigator.see(picture, time)                     # pose with covariance
    answer = navigator.see(picture, time, Goal((1, 2, 1)))    # and guidance

It begins by looking everywhere; the vehicle had better stay where it is meanwhile. A picture whose stamp does not
follow the one before it is refused: the answer says so, and changes nothing; where the clock began anew
(nerfnav/live/clock.py), so does the navigator. A picture that is older than `LiveConfig.oldest_s` by the vehicle's
clock is used at its own time, but nothing is planned from it.
"""

import io
import math
import time as wall_clock
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field

import numpy as np
import torch
from jaxtyping import UInt8
from PIL import Image
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief, FastFilter
from nerfnav.field import Field, GridField, render_image
from nerfnav.geometry import Camera, Pose, so3
from nerfnav.live.answer import OLDEST_S, Answer, CameraCheck, Goal, Guidance, Order
from nerfnav.live.clock import Stamp, VehicleClock, format_stamp
from nerfnav.live.guide import Guide, GuideConfig
from nerfnav.live.messages import Picture
from nerfnav.live.setpoints import GuidedVehicle, compute_guided_action
from nerfnav.robots import RigidState, Robot, StateNoise
from nerfnav.tracking import (
    CameraCheckConfig,
    CameraFit,
    Frame,
    Sighting,
    TrackedFrame,
    Tracker,
    TrackerConfig,
    TrackStatus,
    camera_of_photographs,
    fit_focal_length,
)
from nerfnav.tracking.sources.pictures import decode_picture

OLD = "old"
"""Status of a picture that was refused, see Answer."""
_SMALL = Camera.from_fov(64, 64, 90)
"""Takes the picture by which kernels are compiled."""
_MOST_PIXELS = 1 << 24
"""Largest decoded picture: messages come from outside, so sizes are checked before pixels are unpacked."""


@dataclass(frozen=True)
class LiveConfig:
    """Options of tracking and guidance."""

    tracker: TrackerConfig = dataclass_field(
        default_factory=lambda: TrackerConfig(
            align=None, linear=0.4, angular=4.0, widest=0.12, found=StateNoise(0.012, 0.16, 0.03, 0.5)
        )
    )
    """How it is tracked: by the filter of flights, for vehicles move more abruptly than hands. What was measured of the
    field is used."""
    guide: GuideConfig = dataclass_field(default_factory=GuideConfig)
    """How it is guided."""
    oldest_s: float = OLDEST_S
    """Age from which on nothing is planned from a picture [s]."""


class Navigator:
    """Tracks one vehicle in one field, and guides it; keeps what is believed of it, and its plan."""

    def __init__(
        self, field: Field, robot: Robot, camera: Camera | None = None, mount: Pose | None = None,
        config: LiveConfig | None = None, log: Callable[[str], None] = lambda sentence: None,
    ) -> None:  # fmt: skip
        """Begin without a pose; `camera` and `mount` (T_body_camera) are the robot's own by default.

        `log` takes sentences for people: a wrong stamp, a clock that began anew.
        """
        self.config = LiveConfig() if config is None else config
        self.field, self.robot = field, robot
        self.camera, self.mount = robot.camera if camera is None else camera, robot.mount if mount is None else mount
        tracking = self.config.tracker.for_field(field.info) if isinstance(field, GridField) else self.config.tracker
        self._tracker = Tracker(field, self.camera, GuidedVehicle(robot.name), self.mount, tracking)
        self._guide = Guide(field, robot.with_camera(self.camera, self.mount), self.config.guide)
        self._clock, self._log = VehicleClock(), log
        self._followed: Guidance | None = None
        self._sightings: list[Sighting] = []
        self.camera_fit: CameraFit | None = None
        """Focal length that fits the first pictures that were followed; None until then."""

    def forget(self) -> None:
        """Begin anew: another vehicle comes, or its clock begins anew. Preparations are kept."""
        self._tracker.forget()
        self._guide.forget()
        self._clock = VehicleClock()
        self._followed = self.camera_fit = None
        self._sightings = []

    def prepare(self) -> Iterator[str]:
        """Make what takes seconds, before the first picture; yields what is being done, for people."""
        yield "looking around in the field"
        self._tracker.searcher.looks  # noqa: B018 - made here, and kept
        yield "mapping where the vehicle fits"
        box = self._guide.field.box
        here, there = (RigidState.at_rest(tuple((box.lower + share * box.size).tolist())) for share in (0.5, 0.7))
        here, there = (self._guide.nearest_free(state) or state for state in (here, there))
        yield "compiling kernels, which takes longer the first time"
        belief = Belief(here, StateNoise.isotropic(1e-6).covariance())
        view = render_image(self.field, _SMALL, here.pose.compose(self.mount)).image
        draws = torch.Generator().manual_seed(0)
        run_steps(FastFilter(self.field, self.robot, _SMALL, self.mount).correct(belief, view, draws))
        x, y, z = there.position.tolist()
        self._guide.toward(Goal((x, y, z)), belief, 0.0)
        self._guide.forget()

    def see(
        self, picture: Tensor, time: float, goal: Goal | None = None, now: float | None = None, held: bool = False
    ) -> Answer:
        """Track and guide by a picture (uint8, height x width x RGB) of a time [s] of the vehicle's clock.

        With a `goal` it says what to do to arrive there; `now` is the time of that clock at the call, from which the
        picture's age follows. `held` says that the vehicle does not follow the last guidance, as where that came too
        late (Answer.guidance_at): it is predicted at constant velocities then, and its plan is made anew. Raises
        InvalidInputError for what is no picture of the camera, or no time.
        """
        self._check(picture, time, now)
        clock, stamp = self._clock, self._clock.judge(time)
        if stamp in (Stamp.LATE, Stamp.DOUBTFUL):
            doubt = "; the next picture tells whether the clock began anew" if stamp is Stamp.DOUBTFUL else ""
            before = "" if clock.last is None else f", and one of {format_stamp(clock.last)} was seen before"
            return Answer(time, OLD, f"not used: it was taken at {format_stamp(time)}{before}{doubt}")
        if stamp is Stamp.RESTARTED:
            self.forget()
        if held:
            self._guide.forget()
            self._followed = None
        last = time if self._clock.last is None else self._clock.last
        action = compute_guided_action(self._followed, last, time, not self.robot.planar)
        tracked = self._tracker.observe(Frame(time, picture, f"the picture of {time:.3f} s"), action)
        if (settled := clock.use(time)) is not None:
            self._log(settled)
        self._clock, self._followed = clock, None
        self._compare_camera(tracked, picture)
        answer = replace(_answer(tracked), camera_check=_checked(self.camera_fit))
        if goal is None:
            self._guide.forget()
            return answer
        begun = wall_clock.perf_counter()
        guidance = self._followed = self._guidance(tracked, goal, 0.0 if now is None else now - time)
        return replace(answer, guidance=guidance, plan_ms=1e3 * (wall_clock.perf_counter() - begun))

    def _compare_camera(self, tracked: TrackedFrame, picture: Tensor) -> None:
        """Fit the focal length once, as soon as enough pictures were followed: that takes some 0.3 s."""
        if self.camera_fit is not None or tracked.pose is None or not tracked.status.updated:
            return
        self._sightings.append(Sighting(picture, tracked.pose))
        if len(self._sightings) < CameraCheckConfig.fewest:
            return
        likely = camera_of_photographs(self.field.info, self.camera) if isinstance(self.field, GridField) else None
        noise = self._tracker.config.filter.color_noise
        self.camera_fit = fit_focal_length(self.field, self.camera, self._sightings, noise, likely)
        self._sightings = []

    def _guidance(self, tracked: TrackedFrame, goal: Goal, age: float) -> Guidance:
        """Return the guidance to a goal."""
        oldest = self.config.oldest_s
        if tracked.belief is None or age > oldest or tracked.status in (TrackStatus.FOUND, TrackStatus.FOUND_AGAIN):
            self._guide.forget()
        if tracked.belief is None:
            return Guidance(Order.HOLD, f"it is not known where the vehicle is: {tracked.status.value}")
        if age > oldest:
            return Guidance(Order.HOLD, f"the picture is {age:.2f} s old: plans need one of at most {oldest:g} s")
        return self._guide.toward(goal, tracked.belief, tracked.time)

    def _check(self, picture: Tensor, time: float, now: float | None) -> None:
        """Raise InvalidInputError for what is no picture and no time."""
        if picture.dtype != torch.uint8 or picture.ndim != 3 or picture.shape[-1] != 3:
            raise InvalidInputError(
                f"pictures are uint8, height x width x RGB, not {str(picture.dtype).removeprefix('torch.')} of "
                f"{' x '.join(map(str, picture.shape))}"
            )
        if not math.isfinite(time) or (now is not None and not now >= time):
            raise InvalidInputError(f"a picture is taken at a finite time before now, not at {time} s (now: {now})")


def _checked(fit: CameraFit | None) -> CameraCheck | None:
    """Convert a fit to plain numbers."""
    return None if fit is None else CameraCheck(**fit.numbers, sentence=fit.sentence)


def _answer(tracked: TrackedFrame) -> Answer:
    """Convert a tracked frame to plain numbers."""
    answer = Answer(tracked.time, tracked.status.name.lower(), tracked.status.value, track_ms=tracked.ms)
    if tracked.belief is None:
        return answer
    mean = tracked.belief.mean
    body = replace(tracked, mount=Pose(torch.eye(3), torch.zeros(3)))  # whose pose is the body's own
    assert body.covariance is not None, "where there is a belief there is its covariance"
    w, i, j, k = so3.quaternion_from_matrix(mean.rotation.double()).tolist()
    (x, y, z), (vx, vy, vz) = mean.position.tolist(), mean.velocity.tolist()
    spread = tuple(tuple(row) for row in body.covariance.tolist())
    return replace(answer, position=(x, y, z), quaternion=(w, i, j, k), velocity=(vx, vy, vz), covariance=spread)


def pixels_of(message: Picture, camera: Camera) -> UInt8[Tensor, "height width 3"]:
    """Decode the picture of a message, RGB. Raises InvalidInputError where it is none, or of other proportions."""
    width, height = size = _size(message)
    if min(size) < 1 or width * height > _MOST_PIXELS:
        raise InvalidInputError(f"pictures have at most {_MOST_PIXELS} pixels, not {width} x {height}")
    if message.encoding in ("jpeg", "png"):
        try:
            picture = decode_picture(message.data, aspect=camera.aspect)
        except InvalidInputError as error:
            raise InvalidInputError(f"the picture of {message.time:.3f} s cannot be used: {error}") from error
        camera.for_picture(picture.shape[1], picture.shape[0])
        return picture
    camera.for_picture(width, height)
    if len(message.data) != 3 * width * height:
        raise InvalidInputError(
            f"{width} x {height} pixels of {message.encoding} are {3 * width * height} bytes, not {len(message.data)}"
        )
    rows = np.frombuffer(message.data, np.uint8).reshape(height, width, 3)
    return torch.from_numpy((rows if message.encoding == "rgb8" else rows[..., ::-1]).copy())


def _size(message: Picture) -> tuple[int, int]:
    """Width and height [pixels], as the message or the head of its file says."""
    if message.encoding not in ("jpeg", "png"):
        if message.size is None:
            raise InvalidInputError(f"a picture in {message.encoding} needs its size: width and height")
        return message.size.width, message.size.height
    try:
        with Image.open(io.BytesIO(message.data), formats=[message.encoding]) as picture:
            return picture.size
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InvalidInputError(f"the picture of {message.time:.3f} s is no {message.encoding} file") from error
