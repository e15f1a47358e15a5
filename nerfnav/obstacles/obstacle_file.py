"""Obstacles in files: YAML or JSON, in SI units (m, s, rad). Each has one shape, and may have a motion:

    obstacles:
      - {name: crate, box: [0.4, 0.4, 0.8], position: [1, 0, 0.4], rotation: [0, 0, 0.5], color: [0.8, 0.3, 0.1]}
      - {name: ball, sphere: 0.3, position: [0, 0, 1], motion: {velocity: [0.2, 0, 0]}}
      - {name: post, cylinder: {radius: 0.1, height: 2}, position: [2, 1, 1]}
      - {name: wall, prism: {polygon: [[0, 0], [2, 0], [2, 0.1], [0, 0.1]], heights: [0, 1.5]}}
      - {name: chair, mesh: chair.stl, position: [3, 0, 0]}    # beside the file, closed, in m
      - {name: stone, cut_out: {box: [1, 1, 2], position: [0, 0, 1]}, position: [2, 0, 1]}    # a part of the field

      - {name: cat, sphere: 0.15, motion: {velocity: [0.3, 0, 0]}, seen: true}    # not announced

    motion: {way_points: {points: [[0, 0, 0], [2, 0, 0]], speed: 0.5, closed: true}}
    motion: {velocity: [0.2, 0, 0], max_speed: 0.5}
    motion: {walk: {lower: [-1, -1, 0], upper: [1, 1, 0], speed: 0.4, seed: 3}}
    motion: {trefoil: {scale: [3, 3, 3], phase: 0, slower: 5}}

`rotation` is roll, pitch and yaw. All of a motion is relative to `position`. With `max_speed` the motion is refused
where it may be faster. `write_obstacles` writes files that are JSON and YAML at once, meshes beside them.
"""

import json
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta, structs

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.files import replace_file
from nerfnav.formats import convert_record, read_entries
from nerfnav.obstacles.cut_out import CutOut
from nerfnav.obstacles.motions import (
    STILL,
    ConstantVelocity,
    Motion,
    RandomWalk,
    Still,
    Trefoil,
    WayPoints,
    require_speed,
)
from nerfnav.obstacles.obstacle import MOST, Obstacle, ObstacleSet
from nerfnav.obstacles.shapes import BoxShape, Cylinder, MeshShape, Prism, Shape, Sphere
from nerfnav.robots.body import read_mesh

Coordinate = Annotated[float, Meta(ge=-1e5, le=1e5)]
"""Coordinate [m] or component of a velocity [m/s]: larger ones are in other units."""
Length = Annotated[float, Meta(ge=1e-3, le=1e4)]
"""Edge, radius or height [m]: parts are at least 1 mm thick."""
Rate = Annotated[float, Meta(ge=1e-4, le=1e4)]
"""Speed [m/s], or the time of a radian [s]."""
Point = tuple[Coordinate, Coordinate, Coordinate]
Lengths = tuple[Length, Length, Length]
Share = Annotated[float, Meta(ge=0, le=1)]
_SHAPES = ("box", "sphere", "cylinder", "prism", "mesh", "cut_out")
_MOTIONS = ("way_points", "velocity", "walk", "trefoil")


class CylinderEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Entry `cylinder`: upright, around its origin."""

    radius: Length
    height: Length


class PrismEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Entry `prism`: corners in order, lower and upper height."""

    polygon: Annotated[list[tuple[Coordinate, Coordinate]], Meta(min_length=3, max_length=1000)]
    heights: tuple[Coordinate, Coordinate]


class CutOutEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Entry `cut_out`: a volume, and its pose where the part of the field was cut out."""

    box: Lengths | None = None
    sphere: Length | None = None
    position: Point = (0.0, 0.0, 0.0)
    rotation: Point = (0.0, 0.0, 0.0)


class WayPointsEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Entry `way_points` of a motion."""

    points: Annotated[list[Point], Meta(min_length=2, max_length=10000)]
    speed: Rate
    closed: bool = False


class WalkEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Entry `walk` of a motion."""

    lower: Point
    upper: Point
    speed: Rate
    seed: Annotated[int, Meta(ge=0, le=2**53)] = 0


class TrefoilEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Entry `trefoil` of a motion."""

    scale: Lengths
    slower: Rate
    phase: Coordinate = 0.0


class MotionEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Entry `motion` of an obstacle."""

    way_points: WayPointsEntry | None = None
    velocity: Point | None = None
    walk: WalkEntry | None = None
    trefoil: TrefoilEntry | None = None
    max_speed: Rate | None = None


class ObstacleEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Entry of `obstacles`: one shape, its pose, colour and motion."""

    name: Annotated[str, Meta(max_length=100)] = ""
    box: Lengths | None = None
    sphere: Length | None = None
    cylinder: CylinderEntry | None = None
    prism: PrismEntry | None = None
    cut_out: CutOutEntry | None = None
    mesh: Annotated[str, Meta(min_length=1, max_length=4096, pattern="^[^\\x00\\ud800-\\udfff]*$")] | None = None
    position: Point = (0.0, 0.0, 0.0)
    rotation: Point = (0.0, 0.0, 0.0)
    color: tuple[Share, Share, Share] | None = None
    motion: MotionEntry | None = None
    seen: bool = False


class ObstacleFile(msgspec.Struct, forbid_unknown_fields=True):
    """File of obstacles, in YAML or JSON."""

    obstacles: list[ObstacleEntry]


def read_obstacles(path: Path) -> ObstacleSet:
    """Read the obstacles of a file. Raises InvalidInputError, with the key's path, for one that is impossible."""
    return _set_of(_read_entries(path), path)


def read_obstacle_entries(path: Path) -> tuple[ObstacleEntry, ...]:
    """Read the entries of a file whose obstacles are possible; names and paths of meshes are whole.

    Raises as `read_obstacles` does.
    """
    entries = _read_entries(path)
    return tuple(
        structs.replace(
            entry, name=obstacle.name, mesh=None if entry.mesh is None else str((path.parent / entry.mesh).resolve())
        )
        for entry, obstacle in zip(entries, _set_of(entries, path).obstacles, strict=True)
    )


def format_obstacles(entries: Iterable[ObstacleEntry]) -> str:
    """Write entries as the text of a file, JSON and YAML at once."""
    lines = ",\n".join(json.dumps(msgspec.to_builtins(entry)) for entry in entries)
    return f'{{"obstacles": [\n{lines}\n]}}\n'


def obstacle_of(entry: ObstacleEntry) -> Obstacle:
    """Make the obstacle of an entry whose mesh has its whole path. Raises InvalidInputError for an impossible one."""
    return _obstacle_of(entry, entry.name, Path())


def _read_entries(path: Path) -> list[ObstacleEntry]:
    documents = read_entries(path)
    if len(documents) > 1:
        raise InvalidInputError(f"{path} has {len(documents)} documents: put all obstacles into one")
    entries = convert_record(documents[0], ObstacleFile, path, strict=False).obstacles  # "1e-3" is a number, too
    if not 0 < len(entries) <= MOST:
        raise InvalidInputError(f"{path}: obstacles has {len(entries)} entries, 1 to {MOST} are needed")
    return entries


def _set_of(entries: list[ObstacleEntry], path: Path) -> ObstacleSet:
    named = [
        structs.replace(entry, name=entry.name.strip() or f"obstacle {index + 1}")
        for index, entry in enumerate(entries)
    ]
    found = tuple(
        _obstacle_of(entry, f"{path}: obstacles[{index}]", path.parent) for index, entry in enumerate(named)
    )
    return _checked(f"{path}: obstacles", lambda: ObstacleSet(found))


def write_obstacles(obstacles: ObstacleSet, path: Path) -> tuple[Path, ...]:
    """Write obstacles to a file that `read_obstacles` reads, and the meshes of some beside it; return the files.

    Raises InvalidInputError for a shape or a motion that files do not have.
    """
    entries, meshes = list[ObstacleEntry](), dict[str, MeshShape]()
    for index, obstacle in enumerate(obstacles.obstacles):
        entries.append(_entry_of(obstacle, f"{path.stem}-{index + 1}.ply"))
        if isinstance(obstacle.shape, MeshShape):
            meshes[str(entries[-1].mesh)] = obstacle.shape
    with replace_file(path) as stream:
        stream.write(format_obstacles(entries).encode())
    for name, shape in meshes.items():
        with replace_file(path.parent / name) as stream:
            shape.surface.export(stream, file_type="ply")
    return (path, *(path.parent / name for name in meshes))


def _entry_of(obstacle: Obstacle, mesh: str) -> ObstacleEntry:
    """Describe an obstacle as files do; `mesh` is the name of the file of its mesh, if it is one."""
    entry = ObstacleEntry(
        obstacle.name, position=obstacle.position, rotation=obstacle.rotation, color=obstacle.color,
        motion=_motion_entry_of(obstacle.motion), seen=obstacle.seen,
    )  # fmt: skip
    match obstacle.shape:
        case BoxShape(extents):
            entry.box = extents
        case Sphere(radius):
            entry.sphere = radius
        case Cylinder(radius, height):
            entry.cylinder = CylinderEntry(radius, height)
        case Prism(polygon, heights):
            entry.prism = PrismEntry(list(polygon), heights)
        case CutOut(volume, position, rotation):
            entry.cut_out = CutOutEntry(position=position, rotation=rotation)
            match volume:
                case BoxShape(extents):
                    entry.cut_out.box = extents
                case Sphere(radius):
                    entry.cut_out.sphere = radius
        case MeshShape():
            entry.mesh = mesh
        case shape:
            raise InvalidInputError(f"a {type(shape).__name__} cannot be written: files have {', '.join(_SHAPES)}")
    return entry


def _motion_entry_of(motion: Motion) -> MotionEntry | None:
    match motion:
        case Still():
            return None
        case WayPoints(points, speed, closed):
            return MotionEntry(way_points=WayPointsEntry(list(points), speed, closed))
        case ConstantVelocity(velocity):
            return MotionEntry(velocity=velocity)
        case RandomWalk(lower, upper, speed, seed):
            return MotionEntry(walk=WalkEntry(lower, upper, speed, seed))
        case Trefoil(scale, phase, slower):
            return MotionEntry(trefoil=TrefoilEntry(scale, slower, phase))
        case _:
            raise InvalidInputError(f"a {type(motion).__name__} cannot be written: files have {', '.join(_MOTIONS)}")


def _obstacle_of(entry: ObstacleEntry, where: str, folder: Path) -> Obstacle:
    shape = _checked(where, lambda: _shape_of(entry, folder))
    motion = _checked(f"{where}.motion", lambda: _motion_of(entry.motion))
    if entry.cut_out is not None and motion is not STILL:
        raise InvalidInputError(f"{where} is a cut_out that moves, and parts of a field stand: leave its motion out")
    if entry.cut_out is not None and entry.seen:
        raise InvalidInputError(
            f"{where} is a cut_out that is seen alone, and parts of a field are in the map: leave seen out"
        )
    colored: dict[str, Any] = {} if entry.color is None else {"color": entry.color}
    return _checked(
        where, lambda: Obstacle(entry.name, shape, entry.position, entry.rotation, motion, seen=entry.seen, **colored)
    )


def _shape_of(entry: ObstacleEntry, folder: Path) -> Shape:
    _require_one(entry, _SHAPES, "an obstacle")
    if entry.box is not None:
        return BoxShape(entry.box)
    if entry.sphere is not None:
        return Sphere(entry.sphere)
    if entry.cylinder is not None:
        return Cylinder(entry.cylinder.radius, entry.cylinder.height)
    if entry.cut_out is not None:
        _require_one(entry.cut_out, ("box", "sphere"), "the volume of a cut-out")
        volume = _shape_of(ObstacleEntry(box=entry.cut_out.box, sphere=entry.cut_out.sphere), folder)
        assert isinstance(volume, BoxShape | Sphere)
        return CutOut(volume, entry.cut_out.position, entry.cut_out.rotation)
    if entry.prism is not None:
        return Prism(tuple(entry.prism.polygon), entry.prism.heights)
    file = folder / str(entry.mesh)
    if not os.path.isfile(file):
        raise InvalidInputError(f"there is no mesh {file}")
    mesh = read_mesh(file)
    mesh.merge_vertices()  # corners of an STL belong to one face each
    return MeshShape(mesh)


def _motion_of(entry: MotionEntry | None) -> Motion:
    if entry is None:
        return STILL
    _require_one(entry, _MOTIONS, "a motion")
    motion: Motion
    if entry.way_points is not None:
        motion = WayPoints(tuple(entry.way_points.points), entry.way_points.speed, entry.way_points.closed)
    elif entry.velocity is not None:
        motion = ConstantVelocity(entry.velocity)
    elif entry.walk is not None:
        motion = RandomWalk(entry.walk.lower, entry.walk.upper, entry.walk.speed, entry.walk.seed)
    else:
        assert entry.trefoil is not None
        motion = Trefoil(entry.trefoil.scale, entry.trefoil.phase, entry.trefoil.slower)
    if entry.max_speed is not None:
        require_speed(motion, entry.max_speed)
    return motion


def _require_one(entry: msgspec.Struct, names: tuple[str, ...], what: str) -> None:
    given = [name for name in names if getattr(entry, name) is not None]
    if len(given) != 1:
        counted = f"has {' and '.join(given)}" if given else "has none of them"
        raise InvalidInputError(f"{what} is one of {', '.join(names)}, and this one {counted}")


def _checked(where: str, make: Callable[[], Any]) -> Any:
    """Call `make`, and say in its errors where the value stands."""
    try:
        return make()
    except InvalidInputError as error:
        raise InvalidInputError(f"{where}: {error}") from error
