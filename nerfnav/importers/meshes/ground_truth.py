"""Codec of ground truth: a scene with its own paint to named arrays, and back."""

import json
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import torch
import trimesh

from nerfnav.geometry import Box, picture_file
from nerfnav.world import Image, Paint, Scene, Vantage

FORMAT, VERSION = "nerfnav-ground-truth", 1


def arrays_of(scene: Scene) -> dict[str, np.ndarray]:
    assert scene.paint is not None, "an imported mesh has paint"
    header = {
        "format": FORMAT,
        "version": VERSION,
        "name": scene.name,
        "title": scene.title,
        "sky": scene.sky,
        "voxel": scene.voxel,
        "vantage": scene.vantage.value,
        "images": len(scene.paint.images),
    }
    return {
        "header": np.array(json.dumps(header)),
        "box": np.stack([scene.box.lower.numpy(), scene.box.upper.numpy()]),
        "image_of_face": scene.paint.image_of_face,
        "uv": scene.paint.uv,
        "tint": scene.paint.tint,
        **{f"image_{index}": _bytes(picture_file(image)) for index, image in enumerate(scene.paint.images)},
        **_packed("mesh", [scene.mesh]),
        **_packed("solids", scene.solids),
        **_packed("sheets", scene.sheets),
    }


def scene_of(file: np.lib.npyio.NpzFile, header: dict[str, Any]) -> Scene:
    images = tuple(_picture(file[f"image_{index}"]) for index in range(header["images"]))
    red, green, blue = header["sky"]
    return Scene(
        header["name"],
        header["title"],
        _unpacked("mesh", file)[0],
        tuple(_unpacked("solids", file)),
        Box(*torch.from_numpy(file["box"])),
        (red, green, blue),
        (),
        header["voxel"],
        Paint(images, file["image_of_face"], file["uv"], file["tint"]),
        tuple(_unpacked("sheets", file)),
        Vantage(header["vantage"]),
    )


def _packed(name: str, meshes: Sequence[trimesh.Trimesh]) -> dict[str, np.ndarray]:
    """Meshes as four arrays: their vertices and faces one after the other, and how many each has."""
    return {
        f"{name}_vertices": np.concatenate([np.zeros((0, 3)), *(np.asarray(mesh.vertices, float) for mesh in meshes)]),
        f"{name}_faces": np.concatenate([np.zeros((0, 3), np.int64), *(np.asarray(mesh.faces) for mesh in meshes)]),
        f"{name}_counts": np.array([[len(mesh.vertices), len(mesh.faces)] for mesh in meshes]).reshape(-1, 2),
    }


def _unpacked(name: str, file: np.lib.npyio.NpzFile) -> list[trimesh.Trimesh]:
    ends = np.cumsum(file[f"{name}_counts"], axis=0)[:-1]
    vertices = np.split(file[f"{name}_vertices"], ends[:, 0]) if len(file[f"{name}_counts"]) else []
    faces = np.split(file[f"{name}_faces"], ends[:, 1])
    return [trimesh.Trimesh(v, f, process=False) for v, f in zip(vertices, faces, strict=False)]


def _bytes(content: bytes) -> np.ndarray:
    return np.frombuffer(content, np.uint8)


def _picture(data: np.ndarray) -> Image:
    image = cv2.imdecode(data, cv2.IMREAD_COLOR)
    if image is None:
        raise ValueError("a texture that is no PNG")
    return np.ascontiguousarray(image[..., ::-1])
