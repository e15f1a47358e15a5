"""Triangulation: points where rays through the same feature of two posed photographs meet.

Features are SIFT's (Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 2004), by OpenCV. Two
that match are one point of the place where their rays pass each other within a pixel or two, at an angle that gives
its distance. Nothing here is optimised: poses are known.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import scipy
import torch
from jaxtyping import Float, Int

from nerfnav.geometry import PosedImages


@dataclass(frozen=True)
class TriangulationConfig:
    """Choice of photograph pairs and thresholds for matches."""

    features: int = 600
    """Features per photograph."""
    pictures: int = 120
    """Photographs that are matched, evenly distributed over all."""
    partners: int = 5
    """Others that each of them is compared with."""
    apart_deg: float = 40.0
    """Largest angle between the optical axes of two photographs that are compared [degrees]."""
    ratio: float = 0.75
    """Largest distance of a feature's best match, relative to that of its second best."""
    parallax_deg: float = 2.0
    """Smallest angle between the two rays of a point [degrees]."""
    gap_pixels: float = 1.5
    """Largest distance of the rays where they pass each other, as pixels of the first photograph."""
    neighbours: int = 6
    """Other points that one must have around it."""
    lonely: float = 4.0
    """Distance of these, relative to the median over all points, from which a point counts as a false match."""


@dataclass(frozen=True)
class _Seen:
    """Features of a photograph."""

    descriptors: Float[np.ndarray, "k 128"]
    origin: Float[np.ndarray, "3"]
    directions: Float[np.ndarray, "k 3"]
    """Of the rays through them, in the world."""


def triangulate_points(photographs: PosedImages, config: TriangulationConfig | None = None) -> Float[np.ndarray, "m 3"]:
    """Points of the place [m], in the world; none where photographs show nothing in common."""
    config = config or TriangulationConfig()
    index = np.unique(np.linspace(0, len(photographs) - 1, min(config.pictures, len(photographs))).astype(int))
    seen = [_features(photographs, int(one), config.features) for one in index]
    poses = photographs.poses[torch.from_numpy(index)]
    pairs = _pairs(poses.position.numpy(), -poses.rotation[..., 2].numpy(), config)
    found = [_met(seen[i], seen[j], 1.0 / photographs.camera.fx, config) for i, j in pairs]
    points = np.concatenate([np.zeros((0, 3)), *found])
    return points[_in_company(points, config)]


def _features(photographs: PosedImages, index: int, count: int) -> _Seen:
    grey = cv2.cvtColor(photographs.images[index].numpy(), cv2.COLOR_RGB2GRAY)
    mask = None if photographs.mask is None else photographs.mask[index].numpy().astype(np.uint8)
    keypoints, descriptors = cv2.SIFT_create(nfeatures=count).detectAndCompute(grey, mask)  # type: ignore[attr-defined]
    pose, camera = photographs.poses[index], photographs.camera
    if descriptors is None:
        return _Seen(np.zeros((0, 128), np.float32), pose.position.numpy(), np.zeros((0, 3)))
    # OpenCV's pixel centres are whole numbers, ours are halves
    u, v = (np.array([point.pt for point in keypoints]) + 0.5).T
    ahead = np.stack([(u - camera.cx) / camera.fx, -(v - camera.cy) / camera.fy, -np.ones_like(u)], -1)
    ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True)
    return _Seen(descriptors, pose.position.double().numpy(), ahead @ pose.rotation.double().numpy().T)


def _pairs(
    centers: Float[np.ndarray, "n 3"], forward: Float[np.ndarray, "n 3"], config: TriangulationConfig
) -> Int[np.ndarray, "p 2"]:
    """Pairs of photographs with similar directions and different positions, near and far."""
    alike = forward @ forward.T > np.cos(np.deg2rad(config.apart_deg))
    away = np.linalg.norm(centers[:, None] - centers, axis=-1)
    pairs = []
    for i in range(len(centers)):
        others = np.flatnonzero(alike[i] & (away[i] > 0))
        others = others[np.argsort(away[i][others])][: 8 * config.partners]
        chosen = others[np.unique(np.linspace(0, len(others) - 1, config.partners).astype(int))] if len(others) else []
        pairs += [(min(i, j), max(i, j)) for j in chosen]
    return np.unique(np.array(pairs, int).reshape(-1, 2), axis=0)


def _met(first: _Seen, second: _Seen, pixel: float, config: TriangulationConfig) -> Float[np.ndarray, "m 3"]:
    """Triangulate the matched features of two photographs."""
    i, j = _matches(first.descriptors, second.descriptors, config.ratio)
    a, b, apart = first.directions[i], second.directions[j], second.origin - first.origin
    cosine = (a * b).sum(-1)
    across = np.maximum(1 - cosine**2, 1e-12)
    along_a, along_b = a @ apart, b @ apart
    s, t = (along_a - cosine * along_b) / across, (cosine * along_a - along_b) / across
    near_a, near_b = first.origin + s[:, None] * a, second.origin + t[:, None] * b
    gap = np.linalg.norm(near_a - near_b, axis=-1)
    meets = (s > 0) & (t > 0) & (gap <= config.gap_pixels * pixel * np.minimum(s, t))
    meets &= cosine < np.cos(np.deg2rad(config.parallax_deg))
    return 0.5 * (near_a + near_b)[meets]


def _matches(
    first: Float[np.ndarray, "k 128"], second: Float[np.ndarray, "l 128"], ratio: float
) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
    """Features that are each other's best match, and clearly so."""
    nothing = np.zeros(0, int)
    if min(len(first), len(second)) < 2:
        return nothing, nothing
    matcher = cv2.BFMatcher()
    there = {
        best.queryIdx: best.trainIdx
        for best, other in matcher.knnMatch(first, second, k=2)
        if best.distance < ratio * other.distance
    }
    back = {match.queryIdx: match.trainIdx for match in matcher.match(second, first)}
    mutual = [(i, j) for i, j in there.items() if back[j] == i]
    i, j = np.array(mutual, int).reshape(-1, 2).T
    return i, j


def _in_company(points: Float[np.ndarray, "m 3"], config: TriangulationConfig) -> np.ndarray:
    """Mask of points (m, bool) with enough neighbours, as surfaces have and false matches have not."""
    if len(points) <= config.neighbours:
        return np.zeros(len(points), bool)
    away = scipy.spatial.KDTree(points).query(points, config.neighbours + 1)[0][:, -1]
    return away <= config.lonely * np.median(away)
