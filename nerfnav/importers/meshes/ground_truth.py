"""Ground truth file: the scene, beside the field learned from it, that judges plans and flights there.

npz without pickle; textures are PNG inside. The field's file names it, relative to itself, and holds its SHA-256.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
import trimesh

from nerfnav.core.errors import FieldFileError
from nerfnav.core.files import NpzArrays, open_npz, replace_file
from nerfnav.geometry import Box, encode_image
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
        **{
            f"image_{index}": np.frombuffer(encode_image(image), np.uint8)
            for index, image in enumerate(scene.paint.images)
        },
        **_packed("mesh", [scene.mesh]),
        **_packed("solids", scene.solids),
        **_packed("sheets", scene.sheets),
    }


def scene_of(file: NpzArrays, header: dict[str, Any]) -> Scene:
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


def _unpacked(name: str, file: NpzArrays) -> list[trimesh.Trimesh]:
    ends = np.cumsum(file[f"{name}_counts"], axis=0)[:-1]
    vertices = np.split(file[f"{name}_vertices"], ends[:, 0]) if len(file[f"{name}_counts"]) else []
    faces = np.split(file[f"{name}_faces"], ends[:, 1])
    return [trimesh.Trimesh(v, f, process=False) for v, f in zip(vertices, faces, strict=False)]


def _picture(data: np.ndarray) -> Image:
    image = cv2.imdecode(data, cv2.IMREAD_COLOR)
    if image is None:
        raise ValueError("a texture that is no PNG")
    return np.ascontiguousarray(image[..., ::-1])


@dataclass(frozen=True)
class TruthLink:
    """Link from a field's file to its ground truth."""

    name: str
    """Name of the file, in the same folder."""
    sha256: str
    """Expected SHA-256, as 64 hexadecimal digits."""


def truth_path(field: Path) -> Path:
    """Path of the ground truth of a field file: `house.truth.npz` beside `house.npz`."""
    return field.with_name(f"{field.stem}.truth.npz")


@contextmanager
def write_truth_beside(scene: Scene, field: Path) -> Iterator[TruthLink]:
    """Write a scene with its own paint beside the field file that is written within the block.

    It takes the place of an older one only when the block ends well: both files belong together, or neither changes.
    Raises FieldFileError where it cannot be written.
    """
    path = truth_path(field)
    try:
        with replace_file(path) as stream:
            np.savez_compressed(stream, **arrays_of(scene))  # type: ignore[arg-type] # none is called allow_pickle
            stream.flush()
            yield TruthLink(path.name, _digest(Path(stream.name)))
    except OSError as error:
        raise FieldFileError(f"the ground truth cannot be written to {path}: {error.strerror}") from error


def load_truth(path: Path, sha256: str) -> Scene:
    """Read the ground truth of a field. Raises FieldFileError where it is not the one that the field names."""
    try:
        if _digest(path) != sha256:
            raise FieldFileError(
                f"{path} is not the ground truth that its field was trained from: put the right one there, or train "
                "again; without any, plans are not judged"
            )
        with open_npz(path) as file:
            header = file.header
            if header.get("format") != FORMAT or header["version"] > VERSION:
                raise FieldFileError(f"{path} is no ground truth that this nerfnav can read: train the field again")
            return scene_of(file, header)
    except (ValueError, LookupError, TypeError, ArithmeticError, MemoryError, cv2.error) as error:
        raise FieldFileError(f"{path} is no whole ground truth: train the field again") from error
    except OSError as error:
        raise FieldFileError(f"the ground truth {path} cannot be read: {error.strerror}") from error


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
