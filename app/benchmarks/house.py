"""A furnished house of 20 m for `nerfnav bench open`: six rooms with doors between them, textured, as a mesh file."""

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float, UInt8
from PIL import Image
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals

_LONG, _WIDE, _HIGH = 20.0, 12.0, 2.7
"""Outer length, width, and height of the rooms [m]."""
_WALL, _DOOR, _DOOR_HIGH = 0.16, 1.1, 2.1
"""Thickness of walls, width and height of doors [m]."""
_ROOMS = (3, 2)
"""Rooms along the length and the width."""
_PIECES = 7
"""Pieces of furniture in a room."""
_TEXELS, _TEXTURES, _REPEAT = 192, 12, 1.6
"""Edge of a texture, number of textures, and length that one covers before it repeats [m]."""
_LEG = 0.06
"""Thickness of the legs of a table [m]."""

Extents = tuple[float, float, float]


def write_house(path: Path, seed: int = 0) -> None:
    """Write the house as binary glTF with +Y up; a seed gives the same house again."""
    random = np.random.default_rng(seed)
    pictures = [_texture(random) for _ in range(_TEXTURES)]
    scene = trimesh.Scene()
    to_y_up = trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0])
    for index, mesh in enumerate([*_shell(), *_furniture(random)]):
        scene.add_geometry(_painted(mesh, pictures[index % _TEXTURES]).apply_transform(to_y_up))
    scene.export(path, file_type="glb")


def _texture(random: np.random.Generator) -> UInt8[np.ndarray, "h w 3"]:
    """A pattern of four octaves between two colours, that repeats without a seam."""
    level = np.zeros((_TEXELS, _TEXELS))
    for octave in (4, 8, 16, 48):
        coarse = np.pad(random.random((octave, octave)), ((0, 1), (0, 1)), mode="wrap")
        at = np.arange(_TEXELS) * octave / _TEXELS
        low, share = at.astype(int), at % 1
        rows = coarse[low] * (1 - share)[:, None] + coarse[low + 1] * share[:, None]
        level += (rows[:, low] * (1 - share) + rows[:, low + 1] * share) / 4
    dark, light = random.uniform(0.1, 0.5, 3), random.uniform(0.5, 0.95, 3)
    share = np.clip(2.5 * (level - 0.5) + 0.5, 0, 1)[..., None]
    return (255 * (dark + share * (light - dark))).round().astype(np.uint8)


def _painted(mesh: trimesh.Trimesh, picture: UInt8[np.ndarray, "h w 3"]) -> trimesh.Trimesh:
    """The mesh with a texture on each face, seen along the axis that the face looks to most."""
    corners = mesh.triangles
    along = np.abs(mesh.face_normals).argmax(1)
    across = np.array([(1, 2), (0, 2), (0, 1)])[along]
    uv = np.take_along_axis(corners, across[:, None, :].repeat(3, axis=1), axis=2) / _REPEAT
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    material = PBRMaterial(baseColorTexture=Image.fromarray(picture), metallicFactor=0.0)
    visual = TextureVisuals(uv=uv.reshape(-1, 2), material=material)
    return trimesh.Trimesh(corners.reshape(-1, 3), faces, visual=visual, process=False)


def _box(extents: Extents, middle: Extents) -> trimesh.Trimesh:
    return trimesh.creation.box(extents).apply_translation(middle)


def _shell() -> Iterator[trimesh.Trimesh]:
    """Floor, ceiling, outer walls, and inner walls with a door in the middle of each room's side."""
    for height in (-_WALL / 2, _HIGH + _WALL / 2):
        yield _box((_LONG, _WIDE, _WALL), (_LONG / 2, _WIDE / 2, height))
    for axis, (length, other) in enumerate(((_LONG, _WIDE), (_WIDE, _LONG))):
        doors = (np.arange(_ROOMS[axis]) + 0.5) * length / _ROOMS[axis]
        for wall in range(_ROOMS[1 - axis] + 1):
            inner = 0 < wall < _ROOMS[1 - axis]
            at = min(max(wall * other / _ROOMS[1 - axis], _WALL / 2), other - _WALL / 2)
            yield from _wall(axis, at, length, doors if inner else np.zeros(0))


def _wall(axis: int, at: float, length: float, doors: Float[np.ndarray, " d"]) -> Iterator[trimesh.Trimesh]:
    """A wall along an axis at a distance from the other, in parts beside and above its doors [m]."""
    ends = np.concatenate([[0.0], np.repeat(doors, 2) + np.tile([-_DOOR / 2, _DOOR / 2], len(doors)), [length]])
    for part, (left, right) in enumerate(itertools.pairwise(ends)):
        low = _DOOR_HIGH if part % 2 else 0.0
        middle, extents = [(left + right) / 2, at, (low + _HIGH) / 2], [right - left, _WALL, _HIGH - low]
        swapped = [1, 0, 2] if axis else [0, 1, 2]
        yield _box(*(tuple(values[k] for k in swapped) for values in (extents, middle)))


def _furniture(random: np.random.Generator) -> Iterator[trimesh.Trimesh]:
    """Tables, chests, columns, balls and pictures, off the middle of each room, so that doors stay free."""
    long, wide = _LONG / _ROOMS[0], _WIDE / _ROOMS[1]
    for room in range(_ROOMS[0] * _ROOMS[1]):
        x, y = (room % _ROOMS[0] + 0.5) * long, (room // _ROOMS[0] + 0.5) * wide
        for piece in range(_PIECES):
            turn = 2 * np.pi * (piece + 0.5) / _PIECES + random.uniform(-0.15, 0.15)
            at = (x + 0.33 * long * np.cos(turn), y + 0.33 * wide * np.sin(turn))
            yield from _piece(piece % 4, at, random)
        for side in (-1, 1):
            size = random.uniform(0.6, 1.2)
            yield _box((size, 0.03, 0.7), (x + 0.3 * long, y + side * (wide / 2 - _WALL), 1.6))


def _piece(kind: int, at: tuple[float, float], random: np.random.Generator) -> Iterator[trimesh.Trimesh]:
    x, y = at
    if kind == 0:
        yield _box((1.2, 0.7, 0.05), (x, y, 0.72))
        for i, j in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            yield _box((_LEG, _LEG, 0.72), (x + 0.55 * i, y + 0.3 * j, 0.36))
    elif kind == 1:
        high = random.uniform(0.5, 1.9)
        yield _box((0.8, 0.5, high), (x, y, high / 2))
    elif kind == 2:
        yield trimesh.creation.cylinder(0.2, 1.4, sections=96).apply_translation((x, y, 0.7))
    else:
        # without its lowest faces: what stands on a floor is seldom closed
        ball = trimesh.creation.icosphere(subdivisions=5, radius=0.4).apply_translation((x, y, 0.35))
        ball.update_faces(ball.triangles_center[:, 2] > 0.02)
        yield ball
