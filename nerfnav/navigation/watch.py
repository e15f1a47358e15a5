"""Change detection: regions of a picture that the field cannot show from any pose near the believed one.

Rays of a coarse grid of pixels are rendered once, at the predicted pose. What each shows is a point with a colour,
which is looked for in the picture: within so many pixels of its place as the uncertainty of the pose allows, is there a
colour below and one above each of its channels? If not, something stands before the point. Connected points of this
kind are a region. So neither the error of the pose nor edges make one, and nor do single specks.

The pixels around regions at the predicted pose are left out by the filter. Regions at the corrected pose, which are
sharper, become obstacles (seen_movers.py). A mover in the colours of what it hides is not seen.
"""

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import Belief
from nerfnav.field import FastRenderer, Field, FieldInfo, render_rays
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose
from nerfnav.robots import ATTITUDE, POSITION, Robot

Picture = UInt8[Tensor, "height width 3"]
Mask = Bool[Tensor, "height width"]
_UP = np.array([0.0, 0.0, 1.0])
_RADII = np.array([2, 3, 4, 6, 8, 12])
"""Distances in which a colour is looked for [pixels of a picture 200 wide]."""
_AROUND = np.ones((3, 3), np.uint8)
_NOISIEST = 0.05
"""Largest standard deviation of a field's colours with which a robot may watch. In fields of 0.027 and 0.037, flights
without an obstacle arrived as without the watch; in one of 0.088 two of three pictures showed what is not there, and a
robot that evaded it touched the place."""
_OPAQUE = 0.5
"""Share of the light that a point stops; less, and it is far away."""


@dataclass(frozen=True)
class WatchConfig:
    """Options of the detection."""

    columns: int = 40
    """Rays along a picture's width."""
    noises: float = 3.0
    """Standard deviations of the field's colours that a difference exceeds..."""
    least: float = 0.1
    """...and its least size [1 = full scale]: textures of fields are blurred."""
    sigmas: float = 2.0
    """Standard deviations of the pose within which a static scene may show the picture."""
    fewest: int = 4
    """Fewest rays of a region."""
    most_share: float = 0.6
    """Share of the rays that differ from which on it is the pose that is wrong, and there are no regions."""
    around: int = 2
    """Distance from a region within which the filter leaves pixels out, in rays."""


@dataclass(frozen=True)
class Region:
    """Region of a picture that something hides from the field's view, a rectangle around its middle direction.

    Its sides are along `across`, level, and `along`; sizes are those at a distance of 1 from the camera.
    """

    time: float
    """Time of the picture [s]."""
    origin: Float[np.ndarray, "3"]
    """Camera in the world [m]."""
    direction: Float[np.ndarray, "3"]
    """Unit vector to its middle."""
    across: Float[np.ndarray, "3"]
    """Level unit vector."""
    along: Float[np.ndarray, "3"]
    """Unit vector upwards."""
    width: float
    """Size across."""
    height: float
    """Size along."""
    is_cut: bool
    """True: the picture's border may cut both of its sizes."""
    depth: float
    """Distance of what it hides [m]."""
    resolution: float
    """Distance between rays, at a distance of 1."""
    rays: int
    """Number of its rays."""

    @property
    def size(self) -> float:
        """Larger one of its sizes."""
        return max(self.width, self.height)

    def covers(self, directions: Float[np.ndarray, "n 3"], around: float) -> Bool[np.ndarray, " n"]:
        """Mark directions that are within the rectangle, or `around` it by a size at distance 1."""
        ahead = directions @ self.direction
        x, y = np.abs(directions @ self.across), np.abs(directions @ self.along)
        inside = (x <= (0.5 * self.width + around) * ahead) & (y <= (0.5 * self.height + around) * ahead)
        return inside & (ahead > 0)


@dataclass(frozen=True)
class ExpectedPicture:
    """Points and colours of the field that a picture should show."""

    watch: "Watch"
    """Detection to which it belongs."""
    colors: Float[np.ndarray, "n 3"]
    """Colours [1 = full scale]."""
    points: Float[np.ndarray, "n 3"]
    """Places in the world [m]; of what is far, on the border of the field's box."""
    depth: Float[np.ndarray, " n"]
    """Distances from the camera [m]."""
    belief: Belief
    """Predicted belief from which they were rendered."""

    def hidden(self, image: Picture, known: Mask | None = None) -> Mask | None:
        """Mark the pixels in and around regions, by the predicted belief; None where there is no region.

        What is `known` to stand before the field is not compared.
        """
        seen = self._compare(image, self.belief, known)
        labels = seen.labels()
        if not labels.any():
            return None
        grid, camera = self.watch.grid, self.watch.camera
        square = np.ones((2 * self.watch.config.around + 1,) * 2, np.uint8)
        marked = cv2.dilate((labels > 0).astype(np.uint8).reshape(grid.shape), square)
        whole = cv2.resize(marked, (camera.width, camera.height), interpolation=cv2.INTER_NEAREST)
        return torch.from_numpy(whole).bool()

    def regions(
        self, image: Picture, belief: Belief, time: float, known: Mask | None = None
    ) -> tuple[tuple[Region, ...], "Comparison"]:
        """Find the regions by the corrected belief of a picture at a time [s]; what is `known` is not compared."""
        seen = self._compare(image, belief, known)
        labels = seen.labels()
        return tuple(self._region(labels == label, seen, time) for label in range(1, labels.max() + 1)), seen

    def _compare(self, image: Picture, belief: Belief, known: Mask | None) -> "Comparison":
        watch, camera = self.watch, self.watch.camera
        pose = belief.mean.pose.compose(watch.mount)
        rotation, origin = pose.rotation.double().numpy(), pose.position.double().numpy()
        offsets = self.points - origin
        uv = camera.project(pose, torch.from_numpy(self.points).to(pose.position))[0].double().numpy()
        deviations, unit = belief.covariance.diagonal().sqrt(), camera.width / 200
        # what is nearest around a ray may have moved over it, since the rays were rendered or within the uncertainty
        depth, moved = (
            each.reshape(*watch.grid.shape, -1).astype(np.float32) for each in (self.depth, uv - watch.middles)
        )
        moved = np.nan_to_num(moved, nan=1e3)
        apart = np.linalg.norm(cv2.dilate(moved, _AROUND) - cv2.erode(moved, _AROUND), axis=-1).reshape(-1)
        nearest = np.maximum(cv2.erode(depth, _AROUND).reshape(-1), 1e-3)
        angle = float(deviations[ATTITUDE].max()) + float(deviations[POSITION].max()) / nearest
        wanted = 1 + (watch.config.sigmas * camera.fx * angle + apart) / unit
        place = np.floor(np.nan_to_num(uv, nan=-1.0)).astype(int)
        shown = ((place >= 0) & (place < (camera.width, camera.height))).all(-1) & (wanted <= _RADII[-1])
        if known is not None:
            shown[shown] = ~known.numpy()[place[shown, 1], place[shown, 0]]
        radius = _RADII[np.searchsorted(_RADII, wanted).clip(max=len(_RADII) - 1)]
        picture, differs = image.numpy(), np.zeros(len(radius), bool)
        limit = max(watch.config.least, watch.config.noises * watch.noise_std)
        for each in np.unique(radius[shown]):
            some = np.flatnonzero(shown & (radius == each))
            square = np.ones((2 * max(1, round(each * unit)) + 1,) * 2, np.uint8)
            u, v = place[some].T
            low, high = cv2.erode(picture, square)[v, u] / 255, cv2.dilate(picture, square)[v, u] / 255
            color = self.colors[some]
            differs[some] = np.maximum(low - color, color - high).max(-1) > limit
        return Comparison(watch, rotation, origin, offsets, place, shown, differs, radius * unit)

    def _region(self, mine: Bool[np.ndarray, " n"], seen: "Comparison", time: float) -> Region:
        watch, camera = self.watch, self.watch.camera
        directions = seen.offsets[mine] / np.linalg.norm(seen.offsets[mine], axis=1, keepdims=True)
        middle = directions.mean(0)
        middle /= np.linalg.norm(middle)
        across = np.cross(middle, _UP)
        across = np.array([0.0, 1.0, 0.0]) if (length := np.linalg.norm(across)) < 1e-3 else across / length
        along = np.cross(across, middle)
        flat = np.stack([directions @ across, directions @ along], -1) / (directions @ middle)[:, None]
        grown = (seen.radius[mine].max() + 0.5 * watch.grid.step) / camera.fx
        low, high = flat.min(0) - grown, flat.max(0) + grown
        u, v = seen.place[mine].T
        edge = watch.grid.step + seen.radius[mine]
        cut = (u < edge) | (v < edge) | (u >= camera.width - edge) | (v >= camera.height - edge)
        reach = watch.grid.step / camera.fx
        opens = np.stack([(cut[:, None] & (flat <= flat.min(0) + reach)).any(0),
                          (cut[:, None] & (flat >= flat.max(0) - reach)).any(0)])  # fmt: skip
        size = float((high - low).max())
        for axis in range(2):  # what the border cuts is taken to be as wide as it is high, and the other way round
            missing = size - (high - low)[axis]
            if opens[:, axis].any():
                low[axis] -= missing * opens[0, axis] / opens[:, axis].sum()
                high[axis] += missing * opens[1, axis] / opens[:, axis].sum()
        center = middle + (0.5 * (low + high)) @ np.stack([across, along])
        width, height = (float(each) for each in high - low)
        center /= np.linalg.norm(center)
        return Region(
            time, seen.origin, center, across, along, width, height, bool(opens.any(0).all()),
            float(np.quantile(self.depth[mine], 0.9)), watch.grid.step / camera.fx, int(mine.sum()),
        )  # fmt: skip


@dataclass(frozen=True)
class Comparison:
    """Comparison of a picture with the expected one, ray by ray."""

    watch: "Watch"
    """Detection to which it belongs."""
    rotation: Float[np.ndarray, "3 3"]
    """Camera to world."""
    origin: Float[np.ndarray, "3"]
    """Camera in the world [m]."""
    offsets: Float[np.ndarray, "n 3"]
    """From the camera to the points [m]."""
    place: Int[np.ndarray, "n 2"]
    """Pixels (u, v) of the points."""
    shown: Bool[np.ndarray, " n"]
    """Points that are in the picture, and known exactly enough to compare."""
    differs: Bool[np.ndarray, " n"]
    """Points that the picture does not show."""
    radius: Float[np.ndarray, " n"]
    """Distance in which their colours were looked for [pixels]."""

    def labels(self) -> Int[np.ndarray, " n"]:
        """Number the regions from 1 on; 0 is none."""
        config = self.watch.config
        if self.differs.sum() > config.most_share * max(1, self.shown.sum()):
            return np.zeros(len(self.differs), np.int64)
        grid = self.differs.reshape(self.watch.grid.shape).astype(np.uint8)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(grid, connectivity=8)
        kept = np.flatnonzero(stats[1:, cv2.CC_STAT_AREA] >= config.fewest) + 1
        renumbered = np.zeros(len(stats), np.int64)
        renumbered[kept] = np.arange(1, len(kept) + 1)
        return renumbered[np.asarray(labels, int)].reshape(-1)

    def clears(self, points: Float[np.ndarray, "m 3"]) -> Bool[np.ndarray, " m"]:
        """Mark points in view before which and at which nothing stands: the field shows through them."""
        if not self.shown.any():
            return np.zeros(len(points), bool)
        offsets = points - self.origin
        away = np.linalg.norm(offsets, axis=1)
        length = np.linalg.norm(self.offsets, axis=1)
        alike = (offsets / away[:, None]) @ (self.offsets / length[:, None])[self.shown].T
        nearest = np.flatnonzero(self.shown)[alike.argmax(1)]
        near = alike.max(1) > np.cos(self.watch.grid.step / self.watch.camera.fx)
        return near & ~self.differs[nearest] & (away < length[nearest])


@dataclass(frozen=True)
class RayGrid:
    """Grid of pixels whose rays are compared."""

    pixels: Int[Tensor, "n 2"]
    """(u, v), row by row."""
    shape: tuple[int, int]
    """Rows and columns."""
    step: float
    """Distance between them [pixels]."""


@dataclass(frozen=True)
class Watch:
    """Detection of what a field does not show, by the camera of a robot."""

    field: Field
    """Map."""
    camera: Camera
    """Camera of the pictures."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""
    noise_std: float = 0.05
    """Standard deviation of the field's colours [1 = full scale]."""
    masks: bool = True
    """True: the filter leaves out the pixels of regions."""
    config: WatchConfig = dataclasses.field(default_factory=WatchConfig)
    """Options."""

    @classmethod
    def of(cls, field: Field, robot: Robot, masks: bool = True) -> "Watch":
        """Make the detection of a robot in a field, with the field's measured noise, if it has any.

        Raises InvalidInputError for a field whose colours are too far off.
        """
        info = getattr(field, "info", None)
        measured = info.noise_std if isinstance(info, FieldInfo) else None
        if measured is not None and measured > _NOISIEST:
            raise InvalidInputError(
                f"the colours of this field are off by {measured:.3f}, and a robot that watches would evade what is "
                f"not there: at most {_NOISIEST} will do; train it longer, or leave --watch and obstacles that are "
                "seen out"
            )
        return cls(field, robot.camera, robot.mount, cls.noise_std if measured is None else measured, masks)

    @cached_property
    def grid(self) -> RayGrid:
        """Grid of rays that are rendered."""
        camera, step = self.camera, self.camera.width / self.config.columns
        rows = max(1, round(camera.height / step))
        u = ((np.arange(self.config.columns) + 0.5) * step).astype(int)
        v = ((np.arange(rows) + 0.5) * camera.height / rows).astype(int)
        pixels = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
        return RayGrid(torch.from_numpy(pixels), (rows, len(u)), step)

    @cached_property
    def middles(self) -> Float[np.ndarray, "n 2"]:
        """Middles of the grid's pixels."""
        return self.grid.pixels.double().numpy() + 0.5

    @torch.no_grad()
    def expect(self, belief: Belief) -> ExpectedPicture:
        """Render the grid's rays from a predicted belief."""
        origins, directions = self.camera.rays(belief.mean.pose.compose(self.mount), self.grid.pixels)
        rays = origins.contiguous(), directions.contiguous()
        found = (
            self.field.render_rays(*rays) if isinstance(self.field, FastRenderer) else render_rays(self.field, *rays)
        )
        leaves = torch.maximum(
            (self.field.box.lower - origins) / directions, (self.field.box.upper - origins) / directions
        ).amin(-1)
        opaque = found.opacity > _OPAQUE
        depth = torch.where(opaque, found.depth / found.opacity.clamp_min(_OPAQUE), leaves.clamp_min(1e-3)).double()
        points = origins.double() + depth[:, None] * directions.double()
        return ExpectedPicture(self, found.color.clamp(0, 1).double().numpy(), points.numpy(), depth.numpy(), belief)
