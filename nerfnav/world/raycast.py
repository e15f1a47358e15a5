"""Ray caster and renderer of meshes: find what each ray hits first, and take the mesh's colour there.

No light is computed: the colours of a mesh hold sun and shadow already. Rays that go anywhere are embree's, and so
are those of lenses; the rays of a pinhole camera, of which nearly all pictures are made, are found together.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import torch
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Bool, Float, Float32, UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.jit import kernel
from nerfnav.geometry import Camera, Pose
from nerfnav.world.raster import Hits, Rasteriser
from nerfnav.world.scene import Scene
from nerfnav.world.surface import SurfaceColor, surface_color

Rays = Float32[np.ndarray, "n 3"]
_AT_ONCE = 40_000  # rays: some ten milliseconds
_FACES_PER_RAY = 12
"""Of meshes with more faces for each ray of a picture, asking a tree for each ray takes less time than all faces."""


def scene_color(scene: Scene) -> SurfaceColor:
    """The colours of a scene's mesh, or of its paint where it has any."""
    return surface_color(scene.mesh) if scene.paint is None else scene.paint.color


class RayCaster:
    """Rays against one mesh."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        """Build embree's tree over the mesh's faces."""
        self._scene = EmbreeScene()
        TriangleMesh(self._scene, np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32))

    def first_hits(self, origins: Rays, directions: Rays) -> Hits:
        """The nearest hit of each ray; directions are unit vectors."""
        # a few at a time, for embree holds the interpreter's lock and other threads answer users meanwhile
        face, weights = np.empty(len(origins), np.int32), np.empty((len(origins), 3), np.float32)
        distance = np.empty(len(origins), np.float32)
        for start in range(0, len(origins), _AT_ONCE):
            some = slice(start, start + _AT_ONCE)
            found = self._scene.run(origins[some], directions[some], output=1)
            face[some], weights[some, 1], weights[some, 2] = found["primID"], found["u"], found["v"]
            weights[some, 0] = 1 - found["u"] - found["v"]
            distance[some] = found["tfar"]
        distance[face < 0] = np.inf
        return Hits(face, weights, distance)

    def occluded(self, origins: Rays, directions: Rays) -> Bool[np.ndarray, " n"]:
        """Mark rays that hit anything at all."""
        return self._scene.run(origins, directions, query="OCCLUDED") == 0


@dataclass(frozen=True)
class Picture:
    """Image and depth of a camera in front of a mesh."""

    image: UInt8[Tensor, "height width 3"]
    """sRGB colours, 0 to 255."""
    depth: Float[Tensor, "height width"]
    """Distance along each pixel's central ray [m], infinite where it sees the sky."""
    fine_depth: Float[Tensor, "fine_height fine_width"]
    """The same for every ray that was cast: `supersample` times as many along each side."""


class MeshRenderer:
    """A camera in front of a mesh, of one thread."""

    def __init__(
        self,
        source: Scene | trimesh.Trimesh,
        sky: tuple[float, float, float] = (1.0, 1.0, 1.0),
        supersample: int = 1,
    ) -> None:
        """Look at a scene, under its own sky, or at a mesh under `sky` (sRGB in [0, 1]).

        Each pixel is the mean of `supersample` x `supersample` rays.
        """
        if supersample < 1:
            raise InvalidInputError(f"supersample must be 1 or more, not {supersample}")
        self._mesh = source.mesh if isinstance(source, Scene) else source
        self._sky = np.array(source.sky if isinstance(source, Scene) else sky, np.float32) * 255
        self._color = scene_color(source) if isinstance(source, Scene) else surface_color(source)
        self._supersample = supersample

    def render(self, camera: Camera, pose: Pose) -> Picture:
        """The picture that a camera at `pose` = T_world_camera takes."""
        finer, k = camera.scaled(self._supersample), self._supersample
        hits = self._hits(finer, pose)
        seen = hits.face >= 0
        colors = self._colors(hits, seen)
        image = np.empty((camera.height, camera.width, 3), np.uint8)
        pixels = (camera.height, k, camera.width, k)
        average(colors.reshape(*pixels, 3), seen.reshape(pixels), self._sky, image)
        fine = hits.distance.reshape(finer.height, finer.width)
        depth = np.ascontiguousarray(fine[k // 2 :: k, k // 2 :: k])
        return Picture(*(torch.from_numpy(part) for part in (image, depth, fine)))

    def _colors(self, hits: Hits, seen: Bool[np.ndarray, " n"]) -> Float32[np.ndarray, "n 3"]:
        """The colours that rays see; any colour for those that see the sky."""
        if 2 * np.count_nonzero(seen) > len(seen):  # gathering these would take longer than what the others cost
            return self._color(hits.face, hits.weights)
        colors, some = np.empty((len(seen), 3), np.float32), np.flatnonzero(seen)
        colors[some] = self._color(hits.face.take(some), hits.weights.take(some, axis=0))
        return colors

    def _hits(self, camera: Camera, pose: Pose) -> Hits:
        """Find the first hits of all rays."""
        many = len(self._mesh.faces) > _FACES_PER_RAY * camera.width * camera.height
        if camera.fisheye or camera.distortion or many:
            return self._caster.first_hits(*self._rays(camera, pose))
        return self._raster.first_hits(camera, pose)

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(self._mesh)

    @cached_property
    def _raster(self) -> Rasteriser:
        return Rasteriser(self._mesh)

    @torch.no_grad()
    def _rays(self, camera: Camera, pose: Pose) -> tuple[Rays, Rays]:
        """Origins and directions of all rays."""
        directions = _ray_directions(camera).to(pose.position) @ pose.rotation.transpose(-1, -2)
        origins = pose.position.expand_as(directions)
        return _numpy(origins), _numpy(directions)


@lru_cache(maxsize=4)  # a robot looks with one camera all the time
def _ray_directions(camera: Camera) -> Float[Tensor, "hw 3"]:
    """Directions of all rays in the camera's frame."""
    return camera.directions(camera.pixels())


def _numpy(rays: Float[Tensor, "n 3"]) -> Rays:
    return np.ascontiguousarray(rays.detach().cpu().numpy(), np.float32)


@kernel(exact=True)
def average(colors, seen, sky, image):
    """Fill an image (h, w, 3) with the mean of each pixel's rays: colors (h, k, w, k, 3), or the sky.

    Nothing is reordered or fused, as in `blend`.
    """
    side = colors.shape[1]
    count, half = np.float32(side * side), np.float32(0.5)
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            for channel in range(3):
                total = np.float32(0.0)
                for i in range(side):
                    for j in range(side):
                        ray = colors[row, i, column, j, channel] if seen[row, i, column, j] else sky[channel]
                        total += ray
                image[row, column, channel] = np.uint8(total / count + half)
