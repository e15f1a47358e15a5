"""glTF animation: the path and the robot on it as binary glTF, for Blender and every viewer of models.

glTF is Y-up, the library Z-up: the root node turns the world by -90 degrees about x, so what stands below it keeps
the library's numbers. Below it are the path (lines; of an executed path also the estimate), and a box of the
body's size whose translation [m] and rotation (x, y, z, w) are animated in real time.
"""

import math
from typing import Any

import numpy as np

from nerfnav.core.glb import packed
from nerfnav.export.recording import Exported, Recording, Subject

_FLOAT, _UINT16 = 5126, 5123
_LINES, _TRIANGLES = 1, 4
_COLORS = {"truth": (0.0, 0.84, 1.0), "belief": (1.0, 0.27, 0.0), "robot": (0.0, 0.84, 1.0)}


def gltf(recording: Recording) -> Exported:
    """Export the path, of an executed one also the estimate, and the robot that moves on it."""
    document = _Document({"title": recording.title, "outcome": recording.outcome or "not known"})
    estimates = recording.subject is Subject.ESTIMATE
    paths = {} if estimates else {"truth": recording.position.numpy()}
    if recording.estimated_poses is not None:
        paths["belief"] = recording.estimated_poses[:, :3].numpy()
    for name, points in paths.items():
        document.add_node(name, document.add_mesh(name, points, _pairs(len(points)), _LINES))
    corners, triangles = _box(recording.extents)
    robot = document.add_node("robot", document.add_mesh("robot", corners, triangles, _TRIANGLES))
    document.animate(robot, recording.times.numpy(), recording.position.numpy(), recording.quaternion.numpy())
    return Exported(document.packed(), {"nodes": [*paths, "robot"]})


class _Document:
    """A glTF document that grows."""

    def __init__(self, extras: dict[str, str]) -> None:
        self._extras = extras
        half = math.sqrt(0.5)
        self._nodes: list[dict[str, Any]] = [{"name": "world_z_up", "rotation": [-half, 0, 0, half], "children": []}]
        self._meshes: list[dict[str, Any]] = []
        self._materials: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._views: list[dict[str, Any]] = []
        self._animations: list[dict[str, Any]] = []
        self._binary = b""

    def add_mesh(self, name: str, points: np.ndarray, indices: np.ndarray, mode: int) -> int:
        """A mesh of one colour, by its number."""
        primitive = {
            "attributes": {"POSITION": self._add_array(points)}, "mode": mode,
            "material": len(self._materials), "indices": self._add_array(indices),
        }  # fmt: skip
        self._materials.append({
            "name": name, "pbrMetallicRoughness": {"baseColorFactor": [*_COLORS[name], 1.0]},
            "extensions": {"KHR_materials_unlit": {}}, "doubleSided": True,
        })  # fmt: skip
        self._meshes.append({"name": name, "primitives": [primitive]})
        return len(self._meshes) - 1

    def add_node(self, name: str, mesh: int) -> int:
        """A node in the world, by its number."""
        self._nodes.append({"name": name, "mesh": mesh})
        self._nodes[0]["children"].append(len(self._nodes) - 1)
        return len(self._nodes) - 1

    def animate(self, node: int, times: np.ndarray, positions: np.ndarray, wxyz: np.ndarray) -> None:
        """Move a node: positions [m] and quaternions (w, x, y, z) at times [s]; it stands at the first of them."""
        clock = self._add_array(times)
        tracks = {"translation": positions, "rotation": wxyz[:, [1, 2, 3, 0]]}
        self._nodes[node] |= {path: values[0].tolist() for path, values in tracks.items()}
        samplers = [{"input": clock, "output": self._add_array(values)} for values in tracks.values()]
        channels = [{"sampler": index, "target": {"node": node, "path": path}} for index, path in enumerate(tracks)]
        self._animations.append({"name": "motion", "samplers": samplers, "channels": channels})

    def packed(self) -> bytes:
        """The whole document as a file."""
        document = {
            "asset": {"version": "2.0", "generator": "nerfnav", "extras": self._extras},
            "extensionsUsed": ["KHR_materials_unlit"],
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": self._nodes,
            "meshes": self._meshes,
            "materials": self._materials,
            "animations": self._animations,
            "buffers": [{"byteLength": len(self._binary)}],
            "bufferViews": self._views,
            "accessors": self._accessors,
        }
        return packed(document, self._binary)

    def _add_array(self, array: np.ndarray) -> int:
        whole = np.issubdtype(array.dtype, np.integer)
        data = np.ascontiguousarray(array, dtype="<u2" if whole else "<f4")
        count = data.size if whole else len(data)
        rows = data.reshape(count, -1)
        self._accessors.append(
            {
                "bufferView": len(self._views),
                "componentType": _UINT16 if whole else _FLOAT,
                "count": count,
                "type": "SCALAR" if data.ndim == 1 or whole else f"VEC{data.shape[1]}",
                "min": rows.min(0).tolist(),
                "max": rows.max(0).tolist(),
            }
        )
        self._views.append({"buffer": 0, "byteOffset": len(self._binary), "byteLength": data.nbytes})
        self._binary += data.tobytes() + b"\0" * (-data.nbytes % 4)
        return len(self._accessors) - 1


def _pairs(count: int) -> np.ndarray:
    """Each of `count` points with the next (count - 1, 2)."""
    return np.stack([np.arange(count - 1), np.arange(1, count)], -1)


def _box(extents: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """The eight corners of a box around the origin (8, 3) [m], and its triangles (12, 3)."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    squares = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [triangle for a, b, c, d in squares for triangle in ((a, b, c), (a, c, d))]
    return 0.5 * signs * np.array(extents), np.array(triangles)
