"""How a scene is photographed."""

from dataclasses import dataclass, replace

from nerfnav.world.scene import Scene

FINE_VOXEL = 0.017
"""Voxels up to this size [m] are those of places a few metres wide, the paper's scale."""


@dataclass(frozen=True)
class CaptureConfig:
    """How many photographs are taken, of which size, and from where."""

    images: int = 200
    """Number of photographs."""
    width: int = 200
    """[pixels]"""
    height: int = 200
    """[pixels]"""
    horizontal_fov_deg: float = 90.0
    """Horizontal field of view [degrees]."""
    clearance: float = 0.05
    """Half edge of the cube around a camera that must be free [m]."""
    inside_share: float = 0.8
    """Share of cameras inside the box, where robots fly; the others look in from around it."""
    flight_band: tuple[float, float] = (0.1, 0.85)
    """Lowest and highest camera inside the box, as shares of its height; low ones are more frequent."""
    seen_share: float = 0.25
    """Smallest share of a photograph that must show the mesh and not the sky."""
    supersample: int = 2
    """Rays along each side of a pixel."""
    clear_voxels: float = 3.5
    """A camera keeps so many voxels from surfaces: what is nearer, a field of such voxels cannot tell."""

    def clear_of(self, voxel: float) -> "CaptureConfig":
        """The same for a place whose field has voxels of that size [m], small or large."""
        return replace(self, clearance=self.clear_voxels * voxel)

    def suiting(self, scene: Scene) -> "CaptureConfig":
        """The same for a bundled scene: cameras keep off surfaces by its voxels where those are large."""
        return self if scene.voxel is None or scene.voxel <= FINE_VOXEL else self.clear_of(scene.voxel)
