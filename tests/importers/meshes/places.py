"""Tiny meshes and their files."""

import base64
from pathlib import Path

import numpy as np
import torch
import trimesh
from PIL import Image
from trimesh.exchange.gltf import export_gltf
from trimesh.exchange.obj import export_obj
from trimesh.exchange.off import export_off
from trimesh.visual.material import PBRMaterial, SimpleMaterial
from trimesh.visual.texture import TextureVisuals

from nerfnav.core.steps import run_steps
from nerfnav.geometry.camera import Camera, look_at
from nerfnav.importers.core.placement import Placement
from nerfnav.importers.meshes.config import MeshOptions, SceneConfig
from nerfnav.importers.meshes.importer import ImportedMesh, import_mesh
from nerfnav.world.raycast import MeshRenderer

UP_Z = SceneConfig(Placement(up=(0, 0, 1), scale=1.0), MeshOptions(seen_from="outside"))
CAMERA = Camera.from_fov(40, 40, 90.0)
ABOVE = look_at(torch.tensor([0.0, 0.0, 1.0]), torch.tensor([0.0, 0.0, 0.0]))


def quad(west: float, east: float) -> trimesh.Trimesh:
    """A level square at z = 0 from y = -1 to 1, facing up."""
    corners = np.array([[west, -1, 0], [east, -1, 0], [east, 1, 0], [west, 1, 0]], float)
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def textured(mesh: trimesh.Trimesh, color: tuple[int, int, int], pbr: bool = True) -> trimesh.Trimesh:
    """A quad whose texture is of one colour in the south, and black in the northern half."""
    pixels = np.zeros((8, 8, 3), np.uint8)
    pixels[4:] = color
    image = Image.fromarray(pixels)
    material = PBRMaterial(baseColorTexture=image) if pbr else SimpleMaterial(image=image, diffuse=[255, 255, 255])
    material.name = f"{color[0]}-{color[1]}"
    mesh.visual = TextureVisuals(uv=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float), material=material)
    return mesh


def two_textures(pbr: bool = True) -> trimesh.Scene:
    """Red in the west, green in the east, both black in the north."""
    west, east = textured(quad(-1, 0), (200, 30, 10), pbr), textured(quad(0, 1), (20, 180, 40), pbr)
    return trimesh.Scene({"west": west, "east": east})


def write(scene: trimesh.Scene | trimesh.Trimesh, path: Path) -> Path:
    """Export to the format that the path's ending names, with all files that belong to it."""
    if path.suffix == ".gltf":
        for name, data in export_gltf(scene).items():
            (path if name == "model.gltf" else path.with_name(name)).write_bytes(data)
    elif path.suffix == ".obj":
        text, files = export_obj(scene, return_texture=True, mtl_name=f"{path.stem}.mtl")
        path.write_text(text)
        for name, data in files.items():
            path.with_name(name).write_bytes(data)
    elif path.suffix == ".off":
        path.write_text(export_off(scene.to_mesh() if isinstance(scene, trimesh.Scene) else scene))
    else:
        data = scene.export(file_type=path.suffix[1:])
        path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def imported(path: Path, config: SceneConfig | None = None) -> ImportedMesh:
    return run_steps(import_mesh(path, config))


def seen_from_above(path: Path, config: SceneConfig = UP_Z) -> torch.Tensor:
    """The picture (40, 40, 3) of the square from -1 to 1 at z = 0."""
    return MeshRenderer(imported(path, config).scene).render(CAMERA, ABOVE).image


def write_collada(
    meshes: list[tuple[trimesh.Trimesh, tuple[int, int, int]]], path: Path, up: str = "Z", meter: float = 1.0
) -> Path:
    """A .dae of textured parts, each with a picture of its own beside the file."""
    images, effects, materials, geometries, nodes = [], [], [], [], []
    for k, (mesh, color) in enumerate(meshes):
        Image.fromarray(np.full((4, 4, 3), color, np.uint8)).save(path.with_name(f"{path.stem}{k}.png"))
        corners = " ".join(f"{x:g}" for x in np.asarray(mesh.vertices).reshape(-1))
        faces = " ".join(str(x) for x in np.repeat(np.asarray(mesh.faces).reshape(-1), 2))
        uv = " ".join("0" for _ in range(2 * len(mesh.vertices)))
        images.append(f'<image id="i{k}"><init_from>{path.stem}{k}.png</init_from></image>')
        effects.append(
            f'<effect id="e{k}"><profile_COMMON><newparam sid="s{k}"><surface type="2D"><init_from>i{k}</init_from>'
            f'</surface></newparam><newparam sid="t{k}"><sampler2D><source>s{k}</source></sampler2D></newparam>'
            f'<technique sid="c"><lambert><diffuse><texture texture="t{k}" texcoord="UV"/></diffuse></lambert>'
            "</technique></profile_COMMON></effect>"
        )
        materials.append(f'<material id="m{k}"><instance_effect url="#e{k}"/></material>')
        geometries.append(
            f'<geometry id="g{k}"><mesh>{_source(f"p{k}", corners, "XYZ")}{_source(f"u{k}", uv, "ST")}'
            f'<vertices id="v{k}"><input semantic="POSITION" source="#p{k}"/></vertices>'
            f'<triangles count="{len(mesh.faces)}" material="m{k}"><input semantic="VERTEX" source="#v{k}" offset="0"/>'
            f'<input semantic="TEXCOORD" source="#u{k}" offset="1" set="0"/><p>{faces}</p></triangles></mesh>'
            "</geometry>"
        )
        nodes.append(
            f'<node><instance_geometry url="#g{k}"><bind_material><technique_common><instance_material symbol="m{k}" '
            f'target="#m{k}"/></technique_common></bind_material></instance_geometry></node>'
        )
    path.write_text(
        '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        f'<asset><unit name="u" meter="{meter}"/><up_axis>{up}_UP</up_axis></asset>'
        f"<library_images>{''.join(images)}</library_images><library_effects>{''.join(effects)}</library_effects>"
        f"<library_materials>{''.join(materials)}</library_materials>"
        f"<library_geometries>{''.join(geometries)}</library_geometries>"
        f'<library_visual_scenes><visual_scene id="s">{"".join(nodes)}</visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )
    return path


def _source(name: str, numbers: str, params: str) -> str:
    count = len(numbers.split())
    each = "".join(f'<param name="{param}" type="float"/>' for param in params)
    return (
        f'<source id="{name}"><float_array id="{name}a" count="{count}">{numbers}</float_array><technique_common>'
        f'<accessor source="#{name}a" count="{count // len(params)}" stride="{len(params)}">{each}</accessor>'
        "</technique_common></source>"
    )


def color_at(image: torch.Tensor, x: float, y: float) -> tuple[int, ...]:
    """The colour of the floor's point (x, y) in a picture from above."""
    origins, directions = CAMERA.rays(ABOVE)
    points = (origins - directions / directions[:, 2:])[:, :2]
    index = (points - torch.tensor([x, y])).norm(dim=-1).argmin()
    return tuple(image.reshape(-1, 3)[index].tolist())


def data_uri(data: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()
