"""Captures that tests write themselves: pictures of a sky whose colour is a formula, in every format."""

import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from PIL import Image

from nerfnav.geometry.camera import Camera, Pose, look_at

CAMERA = Camera(48, 36, 40.0, 41.0, 23.0, 18.5)
"""Neither square pixels nor a centred principal point, so that mix-ups show."""
OPENCV_AXES = np.diag([1.0, -1.0, -1.0, 1.0])


def ring(count: int = 8, radius: float = 2.0, height: float = 0.7) -> Pose:
    """Cameras around the origin that look at it, level."""
    angles = torch.linspace(0.3, 6.0, count)
    eyes = torch.stack([radius * angles.cos(), radius * angles.sin(), torch.linspace(0.1, height, count)], -1)
    return look_at(eyes, torch.zeros(count, 3))


def matrices(poses: Pose) -> np.ndarray:
    """T_world_camera (n, 4, 4)."""
    stacked = np.tile(np.eye(4), (len(poses.position), 1, 1))
    stacked[:, :3, :3], stacked[:, :3, 3] = poses.rotation.double().numpy(), poses.position.double().numpy()
    return stacked


def sky(directions: np.ndarray) -> np.ndarray:
    """Colour (..., 3) that is seen in world directions (..., 3), 0 to 255."""
    return (127.5 + 120 * np.sin(2.5 * directions + np.array([0.0, 1.0, 2.0]))).round().astype(np.uint8)


def picture(camera: Camera, pose: np.ndarray, distortion: tuple[float, ...] = ()) -> np.ndarray:
    """What a camera with OpenCV's distortion sees of the sky (height, width, 3); fisheyes have theirs in the camera."""
    u, v = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    pixels = np.stack([u, v], -1).reshape(-1, 1, 2)
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    if camera.fisheye:
        rays = camera.directions(camera.pixels()).double().numpy()
    else:
        flat = cv2.undistortPoints(pixels, matrix, np.array(distortion or (0.0, 0.0, 0.0, 0.0)))[:, 0]
        rays = np.c_[flat[:, 0], -flat[:, 1], -np.ones(len(flat))]
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ pose[:3, :3].T
    return sky(rays).reshape(camera.height, camera.width, 3)


def write_pictures(folder: Path, poses: Pose, camera: Camera = CAMERA, distortion: tuple[float, ...] = ()) -> list[str]:
    """Write images/{index}.png and return their names."""
    (folder / "images").mkdir(parents=True, exist_ok=True)
    names = [f"{index:03}.png" for index in range(len(poses.position))]
    for name, pose in zip(names, matrices(poses), strict=True):
        Image.fromarray(picture(camera, pose, distortion)).save(folder / "images" / name)
    return names


def transforms(names: list[str], poses: Pose, camera: Camera = CAMERA, **head: Any) -> dict[str, Any]:
    """What transforms.json says; entries of `head` replace others, None leaves them out."""
    frames = [
        {"file_path": f"images/{name}", "transform_matrix": pose.tolist()}
        for name, pose in zip(names, matrices(poses), strict=True)
    ]
    said: dict[str, Any] = {
        "w": camera.width, "h": camera.height, "fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy,
        "frames": frames, **head,
    }  # fmt: skip
    return {key: value for key, value in said.items() if value is not None}


def write_transforms(folder: Path, poses: Pose | None = None, camera: Camera = CAMERA, **head: Any) -> Path:
    """Write a whole capture with a transforms.json, and return its folder."""
    poses = ring() if poses is None else poses
    distortion = tuple(float(head.get(key, 0.0)) for key in ("k1", "k2", "p1", "p2", "k3"))
    names = write_pictures(folder, poses, camera, distortion if any(distortion) else ())
    (folder / "transforms.json").write_text(json.dumps(transforms(names, poses, camera, **head)))
    return folder


def changed(folder: Path, change: Any) -> Path:
    """The same capture after `change` of what its transforms.json says, which it alters in place."""
    said = json.loads((folder / "transforms.json").read_text())
    change(said)
    (folder / "transforms.json").write_text(json.dumps(said))
    return folder


def _quaternion(R: np.ndarray) -> np.ndarray:
    """wxyz, by the eigenvector of Bar-Itzhack's matrix: another way than the importer's, which only goes back."""
    K = np.array([
        [R[0, 0] - R[1, 1] - R[2, 2], R[1, 0] + R[0, 1], R[2, 0] + R[0, 2], R[2, 1] - R[1, 2]],
        [R[1, 0] + R[0, 1], R[1, 1] - R[0, 0] - R[2, 2], R[2, 1] + R[1, 2], R[0, 2] - R[2, 0]],
        [R[2, 0] + R[0, 2], R[2, 1] + R[1, 2], R[2, 2] - R[0, 0] - R[1, 1], R[1, 0] - R[0, 1]],
        [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], R[0, 0] + R[1, 1] + R[2, 2]],
    ])  # fmt: skip
    return np.linalg.eigh(K)[1][[3, 0, 1, 2], -1]


def write_colmap(
    folder: Path,
    binary: bool,
    model: tuple[int, str, tuple[float, ...]] | None = None,
    names: list[str] | None = None,
    poses: Pose | None = None,
    camera: Camera = CAMERA,
) -> Path:
    """Write a whole COLMAP capture with one camera, and return its folder."""
    poses = ring() if poses is None else poses
    number, name, numbers = model or (1, "PINHOLE", (CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy))
    written = write_pictures(folder, poses, camera)
    names = names or written
    for old, new in zip(written, names, strict=True):
        (folder / "images" / old).rename(folder / "images" / new)
    sparse = folder / "sparse" / "0"
    sparse.mkdir(parents=True)
    in_camera = [np.linalg.inv(pose @ OPENCV_AXES) for pose in matrices(poses)]
    rows = [(*_quaternion(inverse[:3, :3]), *inverse[:3, 3]) for inverse in in_camera]
    size = CAMERA.width, CAMERA.height
    if binary:
        cameras = struct.pack(f"<QiiQQ{len(numbers)}d", 1, 7, number, *size, *numbers)
        images = struct.pack("<Q", len(rows))
        for index, (row, image) in enumerate(zip(rows, names, strict=True)):
            images += struct.pack("<i7di", index + 1, *row, 7) + image.encode() + b"\0"
            images += struct.pack("<Q", index) + index * struct.pack("<ddq", 1.0, 2.0, -1)
        (sparse / "cameras.bin").write_bytes(cameras)
        (sparse / "images.bin").write_bytes(images)
        return folder
    text = ["# Image list with two lines of data per image:"]
    for index, (row, image) in enumerate(zip(rows, names, strict=True)):
        text += [f"{index + 1} {' '.join(map(repr, map(float, row)))} 7 {image}", "1.0 2.0 -1" if index % 2 else ""]
    (sparse / "images.txt").write_text("\n".join(text) + "\n")
    listed = " ".join(map(repr, numbers))
    (sparse / "cameras.txt").write_text(f"# Camera list\n7 {name} {size[0]} {size[1]} {listed}\n")
    return folder


RADIUS = 3.0
"""The cameras of `ring` stand within a sphere of this radius around the origin: that is what their depths show."""


def depth_ahead(camera: Camera, pose: np.ndarray) -> np.ndarray:
    """Distance of the sphere along the optical axis (height, width)."""
    ways = camera.directions(camera.pixels()).double().numpy() @ pose[:3, :3].T
    eye = pose[:3, 3]
    inward = ways @ eye
    away = -inward + np.sqrt(inward**2 + RADIUS**2 - eye @ eye)
    return (away * -(ways @ pose[:3, :3])[:, 2]).reshape(camera.height, camera.width)


Point = tuple[tuple[float, float, float], float, list[int]]
"""A point of structure from motion: where it is, its error [pixels], and the numbers of the images that show it."""


def write_points(capture: Path, binary: bool, points: list[Point]) -> Path:
    """Write the points of a COLMAP capture, whose images count from 1, and return its folder."""
    sparse = capture / "sparse" / "0"
    if binary:
        packed = struct.pack("<Q", len(points))
        for number, (position, error, track) in enumerate(points):
            packed += struct.pack("<Q3d3Bd", number + 7, *position, 10, 20, 30, error)
            packed += struct.pack("<Q", len(track)) + b"".join(struct.pack("<ii", image, 5) for image in track)
        (sparse / "points3D.bin").write_bytes(packed)
        return capture
    lines = ["# 3D point list with one line of data per point:"]
    for number, (position, error, track) in enumerate(points):
        seen = " ".join(f"{image} 5" for image in track)
        lines.append(f"{number + 7} {' '.join(map(repr, position))} 10 20 30 {error!r} {seen}")
    (sparse / "points3D.txt").write_text("\n".join(lines) + "\n")
    return capture
