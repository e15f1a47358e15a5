"""Light baked into colours: a late sun with its shadows, and a sky that reaches less far into corners.

Sun that falls through glass takes on its colour.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from trimesh.visual.color import ColorVisuals

from nerfnav.geometry import color as srgb
from nerfnav.world import RayCaster

Color = tuple[float, float, float]


@dataclass(frozen=True)
class Light:
    """Sun and sky; colours are linear."""

    azimuth_deg: float = 218.0
    """Azimuth of the sun, counted from east to north [degrees]."""
    elevation_deg: float = 29.0
    """Elevation of the sun [degrees]."""
    sun: Color = (2.55, 1.98, 1.36)
    """Light of the sun."""
    sky: Color = (0.36, 0.44, 0.57)
    """Light of the whole sky."""
    bounce: Color = (0.10, 0.09, 0.06)
    """Light that the ground reflects upwards."""
    sun_rays: int = 6
    """Shadow rays to the sun's disk."""
    sky_rays: int = 48
    """Shadow rays to the sky."""
    sun_through_glass: bool = True
    """The sun falls through glass; else the sky alone does, as through a ceiling that glows."""


def lit(
    parts: Sequence[trimesh.Trimesh], albedos: Sequence[np.ndarray], light: Light, panes: int = 0
) -> trimesh.Trimesh:
    """One mesh of all parts, whose vertex colours are the parts' linear colours (v, 3) under the light.

    The last `panes` parts are glass: they throw no shadow and shine in their own colours.
    """
    solid = len(parts) - panes
    opaque, colors = _joined(parts[:solid]), np.concatenate(albedos[:solid])
    glass = Glass(_joined(parts[solid:]), np.concatenate(albedos[solid:])) if panes else None
    baked = bake(opaque, colors, light, glass)
    mesh = opaque
    if glass is not None:
        mesh = _joined([opaque, glass.mesh])
        baked = np.concatenate([baked, to_srgb(glass.color)])
    mesh.visual = ColorVisuals(mesh, vertex_colors=baked)
    return mesh


def _joined(parts: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = np.concatenate([part.faces + offset for part, offset in zip(parts, offsets, strict=True)])
    return trimesh.Trimesh(np.concatenate([part.vertices for part in parts]), faces, process=False)


class Glass:
    """Panes that colour the light that falls through them."""

    def __init__(self, mesh: trimesh.Trimesh, color: np.ndarray) -> None:
        """Panes with the linear colours (v, 3) of their vertices."""
        self.mesh, self.color = mesh, color
        self._caster = RayCaster(mesh)
        self._of_faces = color[mesh.faces].mean(1)

    def tint(self, origins: np.ndarray, rays: np.ndarray) -> np.ndarray:
        """Colour of white light (n, 3) that comes to `origins` against `rays`."""
        face = self._caster.first_hits(origins, rays).face
        return np.where(face[:, None] >= 0, self._of_faces[face], 1.0)


def bake(mesh: trimesh.Trimesh, albedo: np.ndarray, light: Light, glass: Glass | None = None) -> np.ndarray:
    """sRGB bytes (v, 3) of a mesh's vertices, whose own colours `albedo` (v, 3) are linear."""
    caster = RayCaster(mesh)
    normals = mesh.vertex_normals.astype(np.float32)
    origins = mesh.vertices.astype(np.float32) + 0.003 * normals

    def received(directions: np.ndarray, through: Glass | None) -> np.ndarray:
        """Mean over directions (k, 3) of cosine times visibility, for each vertex and colour (v, 3)."""
        total = np.zeros((len(normals), 3), np.float32)
        for direction in directions.astype(np.float32):
            cosine = normals @ direction
            facing = np.flatnonzero(cosine > 0)
            rays = np.broadcast_to(direction, (len(facing), 3)).copy()
            lit_ = ~caster.occluded(origins[facing], rays)
            facing, rays = facing[lit_], rays[lit_]
            tint = 1.0 if through is None else through.tint(origins[facing], rays)
            total[facing] += cosine[facing, None] * tint
        return total / len(directions)

    # the sky is so wide that the colour of the panes averages out
    sky = 2 * received(_dome(light.sky_rays), None)
    if glass is not None and not light.sun_through_glass:
        glass = Glass(glass.mesh, np.zeros_like(glass.color))
    sun, sky = _unbury(mesh, np.stack([received(_sun_disk(light), glass), sky]), sky[:, 0] < 0.02)
    down = 0.5 - 0.5 * normals[:, 2]
    shades = sun * light.sun + sky * light.sky + np.outer(down, light.bounce)
    return to_srgb(albedo * shades)


def _unbury(mesh: trimesh.Trimesh, values: np.ndarray, buried: np.ndarray) -> np.ndarray:
    """Values (k, v, 3) whose buried vertices take the mean of their neighbours in the open.

    Else the dark of a vertex inside a stone would leak along edges into what is seen of the ground.
    """
    ends = np.concatenate([mesh.edges_unique, mesh.edges_unique[:, ::-1]])
    ends = ends[buried[ends[:, 0]] & ~buried[ends[:, 1]]]
    count = np.bincount(ends[:, 0], minlength=len(buried))
    channels = np.moveaxis(values, -1, 1).reshape(-1, len(buried))
    lent = np.stack([np.bincount(ends[:, 0], channel[ends[:, 1]], len(buried)) for channel in channels])
    lent = np.moveaxis(lent.reshape(len(values), 3, -1), 1, -1)
    return np.where(count[:, None] > 0, lent / np.maximum(count, 1)[:, None], values)


def _sun_disk(light: Light) -> np.ndarray:
    """Directions (k, 3) on a ring about 2 degrees around the sun: a soft edge of the shadows."""
    azimuth, elevation = np.radians([light.azimuth_deg, light.elevation_deg])
    center = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    side = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
    turn = 2 * np.pi * np.arange(light.sun_rays) / light.sun_rays
    ring = center + 0.035 * (np.outer(np.cos(turn), side) + np.outer(np.sin(turn), np.cross(center, side)))
    return ring / np.linalg.norm(ring, axis=1, keepdims=True)


def _dome(count: int) -> np.ndarray:
    """Directions (count, 3) spread evenly over the upper half of the sphere (Fibonacci spiral)."""
    index = np.arange(count) + 0.5
    height = index / count
    turn = np.pi * (1 + 5**0.5) * index
    flat = np.sqrt(1 - height**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), height], -1)


def to_srgb(linear: np.ndarray) -> np.ndarray:
    """Bytes of linear colours, bright ones rolled off softly towards white."""
    rolled = linear / (1 + np.maximum(0, linear - 0.6) * 0.45)
    return np.round(255 * srgb.to_srgb(np.clip(rolled, 0, 1))).astype(np.uint8)


def from_srgb(color: Color) -> np.ndarray:
    """The linear colour of an sRGB colour in [0, 1]."""
    return srgb.to_linear(np.asarray(color, float))
