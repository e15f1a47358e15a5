"""Endings of the files that can be read, apart from what reads them: naming them must not import it."""

FIELD = ".npz"
"""A field that nerfnav wrote."""
MESHES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".dae")
SPLATS = (".ply", ".splat", ".spz", ".sog", ".ksplat")
"""Gaussian splats; a .ply may be a mesh instead."""
OWN_SPLATS = ".splats.npz"
"""nerfnav's own files of splats, which lie beside the field that was made of them."""
CHECKPOINTS = (".ckpt", ".tar", ".pth", ".pt")
"""Trained NeRFs."""
ARCHIVES = (".zip", ".r3d")
"""Archives that hold a capture or a mesh."""
VIDEOS = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm")
PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff", ".heic")
UPLOADS = tuple(dict.fromkeys((FIELD, *MESHES, *SPLATS, *ARCHIVES, *VIDEOS, *CHECKPOINTS)))
"""All that can be opened as one file."""
