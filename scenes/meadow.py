"""The ground of Stonehenge: a round meadow with paths, chalk, heather, a ditch and a bank."""

import numpy as np
import trimesh

from nerfnav_scenes.light import from_srgb
from nerfnav_scenes.noise import fractal, mix, noise, smoothstep
from nerfnav_scenes.primitives import disk

_THICKNESS = 0.075
_ENTRANCE_DEG = 50.0
_GRASS, _DRY, _DARK = (0.46, 0.53, 0.26), (0.63, 0.60, 0.37), (0.29, 0.39, 0.20)
_EARTH, _CHALK = (0.52, 0.42, 0.31), (0.84, 0.80, 0.70)
_FLOWERS = [(0.58, 0.38, 0.56), (0.88, 0.76, 0.32), (0.88, 0.87, 0.82)]


def meadow(radius: float, edge: float) -> tuple[trimesh.Trimesh, np.ndarray]:
    """The ground as a solid, its top between -3 cm and 0 but for the bank, and its linear colours (v, 3)."""
    mesh = disk(radius, _THICKNESS, edge)
    flat = mesh.vertices.copy()
    share = 1 + flat[:, 2] / _THICKNESS  # the underside stays flat
    mesh.vertices = flat + np.outer(share * _height(flat * [1, 1, 0], radius), [0, 0, 1])
    color = _color(flat * [1, 1, 0])
    rim = smoothstep(0.0, -0.02, flat[:, 2])
    layers = from_srgb(_EARTH) * (1 + 0.5 * fractal(mesh.vertices * [1, 1, 4], 0.08, 60)[:, None])
    return mesh, mix(color, layers, rim)


def _off_axis(points: np.ndarray) -> np.ndarray:
    """Distance from the avenue's axis, which leaves the centre at the entrance [m]."""
    angle = np.radians(_ENTRANCE_DEG)
    along = points[:, 0] * np.cos(angle) + points[:, 1] * np.sin(angle)
    across = points[:, 1] * np.cos(angle) - points[:, 0] * np.sin(angle)
    return np.where(along > 0, np.abs(across), 9.0)


def _height(points: np.ndarray, radius: float) -> np.ndarray:
    """Height of the ground [m]."""
    reach = np.linalg.norm(points[:, :2], axis=1)
    open_ = smoothstep(0.10, 0.20, _off_axis(points))
    ripple = 0.006 * noise(points, 0.25, 51) + 0.003 * noise(points, 0.06, 52)
    ditch = -0.018 * np.exp(-(((reach - (radius - 0.16)) / 0.035) ** 2))
    bank = 0.06 * np.exp(-(((reach - (radius - 0.075)) / 0.045) ** 2)) * (1 + 0.4 * noise(points, 0.2, 53))
    return np.minimum(ripple - 0.008, 0) + open_ * (ditch + bank)


def _color(points: np.ndarray) -> np.ndarray:
    """Linear colours: grass in patches, trodden paths, chalk in the ditch, flowers in drifts."""
    reach = np.linalg.norm(points[:, :2], axis=1)
    grass = np.tile(from_srgb(_GRASS), (len(points), 1))
    color = mix(grass, from_srgb(_DRY), smoothstep(-0.2, 0.8, fractal(points, 0.30, 61)))
    color = mix(color, from_srgb(_DARK), smoothstep(0.0, 0.7, fractal(points, 0.14, 62)))
    wander = 0.05 * noise(points, 0.3, 63)
    trodden = np.exp(-(((reach - 0.66 + wander) / 0.06) ** 2))
    avenue = smoothstep(0.13, 0.06, _off_axis(points) + wander)
    ditch = np.exp(-(((reach - 1.11 + 0.3 * wander) / 0.03) ** 2)) * smoothstep(0.08, 0.2, _off_axis(points))
    worn = np.maximum(trodden, avenue)
    patchy = 0.65 + 0.45 * fractal(points, 0.10, 64)
    color = mix(color, from_srgb(_EARTH), np.clip(patchy * worn, 0, 1))
    chalk = np.maximum(0.8 * ditch, 0.8 * worn * smoothstep(0.15, 0.6, fractal(points, 0.07, 65)))
    color = mix(color, from_srgb(_CHALK), np.clip(patchy * chalk, 0, 1))
    for k, flower in enumerate(_FLOWERS):
        drift = smoothstep(0.3, 0.7, noise(points, 0.40, 70 + k)) * smoothstep(0.3, 0.8, noise(points, 0.032, 80 + k))
        color = mix(color, from_srgb(flower), 0.7 * drift * (1 - worn))
    tufts = 0.26 * noise(points, 0.07, 66) + 0.32 * noise(points, 0.028, 67)
    return color * np.exp(tufts)[:, None]
