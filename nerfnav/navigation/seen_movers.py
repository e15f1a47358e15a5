"""Seen movers: the space that regions of pictures may occupy, now and soon.

One camera sees directions and sizes, no distances. A thing of size S that looks as large as s_k at distance 1 (of
several pictures k) was at the distance S / s_k; so each size gives a place in each picture, and a track:

    y_k(S) = c_k + (S / s_k) u_k = p + v (t_k - t) + noise,   v ~ N(0, speed^2 I)

with c_k the camera and u_k the direction. A straight line is fitted for each of several sizes, from that of the robot
up to that which reaches what the thing hides; lines that pictures contradict are dropped, which takes a robot that
manoeuvres. All that is left counts as solid: a chain of boxes along the whole ray, which move, enlarged by their
uncertainty. What left the view goes on for some time, and is forgotten. A place through which a later picture shows the
field is free.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float
from torch import Tensor

from nerfnav.navigation.watch import Comparison, Region
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle
from nerfnav.planner import Movers


@dataclass(frozen=True)
class SeenConfig:
    """Assumptions on what is seen."""

    ratio: float = 1.5
    """Ratio of the sizes of neighbours in the chain."""
    speed: float = 0.8
    """Standard deviation of a coordinate of a velocity [m/s]."""
    fastest: float = 4.0
    """Speed that nothing exceeds [m/s]."""
    size_std: float = 0.15
    """Standard deviation of a size in a picture, as a share of it..."""
    cut_std: float = 0.5
    """...and where the picture's border cuts it."""
    gate: float = 16.0
    """Largest chi-squared of a line beyond that of the best one."""
    memory: int = 8
    """Pictures of a thing that count."""
    sure: int = 12
    """Rays of a region that counts at once; a smaller one must be seen twice."""
    many: int = 3
    """Regions of a picture from which on none counts at once."""
    room: float = 0.4
    """Distance of a robot from what did not touch it, in least sizes of a thing."""
    sigmas: float = 1.0
    """Standard deviations by which boxes are enlarged..."""
    horizon_s: float = 0.3
    """...at this time after the picture [s]."""
    forget_s: float = 0.8
    """Time after which what is out of view is forgotten [s]..."""
    forget_each_s: float = 0.2
    """...and for each picture of it, if that is less [s]."""
    hurry: float = 1.3
    """Largest mean speed of the rest of a flight, as a multiple of the first plan's."""
    around: float = 0.1
    """Distance of a region from where a thing should be, at a distance of 1 from the camera."""


@dataclass(frozen=True)
class Chain:
    """Possible tracks of one thing, one for each size."""

    time: float
    """Time of the places [s]."""
    sizes: Float[np.ndarray, " h"]
    """Sizes S [m]."""
    places: Float[np.ndarray, "h 3"]
    """Places p [m]."""
    velocities: Float[np.ndarray, "h 3"]
    """Velocities v [m/s]."""
    covariances: Float[np.ndarray, "h 6 6"]
    """Of place and velocity."""

    def at(self, time: float) -> Float[np.ndarray, "h 3"]:
        """Places at a time [s]."""
        return self.places + (time - self.time) * self.velocities

    def where(self, kept: np.ndarray) -> "Chain":
        """The tracks that are kept."""
        return Chain(self.time, self.sizes[kept], self.places[kept], self.velocities[kept], self.covariances[kept])


@dataclass(frozen=True)
class SeenMover:
    """One thing that pictures show and the field does not."""

    regions: tuple[Region, ...]
    """Regions of pictures that show it, the latest last."""
    chain: Chain
    """Its possible tracks."""

    def is_sure(self, config: SeenConfig) -> bool:
        """Check whether it counts: it is large, or was seen twice."""
        latest = self.regions[-1]
        return latest.rays >= config.sure or len(self.regions) > 1

    def obstacles(self, config: SeenConfig, name: str) -> list[Obstacle]:
        """Make the boxes of its chain; their time is that of the flight."""
        latest, chain, found = self.regions[-1], self.chain, list[Obstacle]()
        axes = np.stack([latest.direction, latest.across, latest.along])
        for index, size in enumerate(chain.sizes):
            distance, covariance = size / latest.size, chain.covariances[index]
            ahead = np.concatenate([axes, config.horizon_s * axes], axis=1)
            sigma = np.sqrt(np.einsum("ij,jk,ik->i", ahead, covariance, ahead))
            depth = min(max(0.5 * size, distance * (np.sqrt(config.ratio) - 1)), 0.8 * distance)
            grown = config.sigmas * sigma[1:]
            extents = (2 * depth, distance * latest.width + 2 * grown[0], distance * latest.height + 2 * grown[1])
            x, y, z = (float(each) for each in chain.places[index] - chain.time * chain.velocities[index])
            u, v, w = (float(each) for each in chain.velocities[index])
            rotation = (0.0, -float(np.arcsin(latest.direction[2].clip(-1, 1))),
                        float(np.arctan2(latest.direction[1], latest.direction[0])))  # fmt: skip
            shape = BoxShape((float(extents[0]), float(extents[1]), float(extents[2])))
            motion = ConstantVelocity((u, v, w))
            found.append(Obstacle(f"{name} {index + 1}", shape, (x, y, z), rotation, motion))
        return found


@dataclass(frozen=True)
class SeenMovers:
    """All that pictures show and the field does not."""

    things: tuple[SeenMover, ...] = ()
    """The things, also those that do not count yet."""
    least: float = 0.1
    """Least size of a thing [m]."""
    pace: float = np.inf
    """Mean speed of the first plan [m/s]."""
    config: SeenConfig = field(default_factory=SeenConfig)
    """Assumptions."""

    @property
    def movers(self) -> Movers | None:
        """As planners take them; None where there is nothing."""
        found = [
            box
            for index, thing in enumerate(self.things) if thing.is_sure(self.config)
            for box in thing.obstacles(self.config, f"seen {index + 1}")
        ]  # fmt: skip
        return Movers(tuple(found)) if found else None

    def steps_at_pace(self, path: Float[Tensor, "n 3"], dt: float) -> int:
        """Count the time steps of `dt` [s] that a path [m] takes at the pace of the first plan: a robot that has waited
        does not hurry."""
        length = path.diff(dim=0).norm(dim=-1).sum().item()
        return math.ceil(length / (self.config.hurry * self.pace * dt))

    def after(self, regions: tuple[Region, ...], seen: Comparison | None, time: float) -> "SeenMovers":
        """Return what is known after a picture at a time [s] with these regions; without one, after its absence."""
        if len(regions) >= self.config.many:  # they may come of a wrong pose: each must be seen twice
            regions = tuple(replace(region, rays=min(region.rays, self.config.sure - 1)) for region in regions)
        left, things = list(regions), list[SeenMover]()
        for thing in self.things:
            mine = [region for region in left if self._is_of(region, thing, time)]
            if mine:
                region = max(mine, key=lambda each: each.rays)
                left = [each for each in left if not any(each is other for other in mine)]
                things.append(self._seen_again(thing, region))
            elif (lasting := self._unseen(thing, seen, time)) is not None:
                things.append(lasting)
        things.extend(SeenMover((region,), fit_chain((region,), self.least, self.config)) for region in left)
        if seen is not None:
            things = [free for thing in things if (free := self._beside(thing, seen.origin, time)) is not None]
        return replace(self, things=tuple(things))

    def _beside(self, thing: SeenMover, camera: Float[np.ndarray, "3"], time: float) -> SeenMover | None:
        """Drop places that hold the camera, which was touched by nothing; None where no other is left."""
        boxes, room = thing.obstacles(self.config, "thing"), self.config.room * self.least
        kept = np.array([box.signed_distance(camera[None], time)[0] > room for box in boxes])
        return replace(thing, chain=thing.chain.where(kept)) if kept.any() else None

    def _is_of(self, region: Region, thing: SeenMover, time: float) -> bool:
        """Check whether a region may show a thing."""
        offsets = thing.chain.at(time) - region.origin
        away = np.linalg.norm(offsets, axis=1)
        near = self.config.around + 0.5 * thing.regions[-1].size
        return bool(region.covers(offsets / np.maximum(away, 1e-6)[:, None], near).any())

    def _seen_again(self, thing: SeenMover, region: Region) -> SeenMover:
        regions = (*thing.regions, region)[-self.config.memory :]
        return SeenMover(regions, fit_chain(regions, self.least, self.config))

    def _unseen(self, thing: SeenMover, seen: Comparison | None, time: float) -> SeenMover | None:
        """Keep what may have left the view; None where it did not count yet, is long ago, or would be seen."""
        forget_s = min(self.config.forget_s, self.config.forget_each_s * len(thing.regions))
        if not thing.is_sure(self.config) or time - thing.regions[-1].time > forget_s:
            return None
        if seen is None:
            return thing
        kept = ~seen.clears(thing.chain.at(time))
        return replace(thing, chain=thing.chain.where(kept)) if kept.any() else None


def fit_chain(regions: tuple[Region, ...], least: float, config: SeenConfig) -> Chain:
    """Fit a straight track for each size from `least` [m] on; where all contradict, the thing is as if just seen."""
    latest = regions[-1]
    farthest = max(latest.depth, 2 * least / latest.size)
    count = 2 + int(np.log(farthest * latest.size / least) / np.log(config.ratio))
    sizes = least * config.ratio ** np.arange(count)
    information = np.zeros((count, 6, 6))
    information[:, range(3, 6), range(3, 6)] = 1 / config.speed**2
    right, squares = np.zeros((count, 6)), np.zeros(count)
    for region in regions:
        distance = sizes / region.size
        spread = config.cut_std if region.is_cut else config.size_std
        sideways = 1 / ((0.5 if region.is_cut else 0.25) * region.resolution * distance) ** 2
        straight = 1 / (spread * distance) ** 2
        line = np.outer(region.direction, region.direction)
        weight = straight[:, None, None] * line + sideways[:, None, None] * (np.eye(3) - line)
        since = region.time - latest.time
        model = np.concatenate([np.eye(3), since * np.eye(3)], axis=1)
        place = region.origin + distance[:, None] * region.direction
        information += model.T @ weight @ model
        weighted = np.einsum("hij,hj->hi", weight, place)
        right += weighted @ model
        squares += np.einsum("hi,hi->h", weighted, place)
    covariances = np.linalg.inv(information)
    found = np.einsum("hij,hj->hi", covariances, right)
    misfit = squares - np.einsum("hi,hi->h", found, right)
    chain = Chain(latest.time, sizes, found[:, :3], found[:, 3:], covariances)
    speeds = np.linalg.norm(chain.velocities, axis=1)
    kept = (misfit <= misfit.min() + config.gate) & (speeds <= config.fastest)
    if len(regions) > 1 and (misfit.min() > config.gate * len(regions) or not kept.any()):
        return fit_chain(regions[-1:], least, config)
    return chain.where(kept)
