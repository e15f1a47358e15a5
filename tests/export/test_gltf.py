"""The path as a model."""

import numpy as np
import pytest
import torch
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.glb import packed, parts
from nerfnav.export.gltf import gltf
from nerfnav.geometry import so3
from tests.export.flights import flight, flown, plan


def arrays_of(content: bytes) -> tuple[dict, list[np.ndarray]]:
    """The document of a file, and the arrays of its accessors."""
    document, binary = parts(content)
    widths = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
    arrays = []
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        kind = {5126: "<f4", 5123: "<u2"}[accessor["componentType"]]
        count = accessor["count"] * widths[accessor["type"]]
        arrays.append(np.frombuffer(binary, kind, count, view["byteOffset"]).reshape(accessor["count"], -1))
    return document, arrays


def test_the_animation_reads_back_as_the_states_and_the_root_turns_up_to_y() -> None:
    document, arrays = arrays_of(gltf(flight()).content)
    root = document["nodes"][document["scenes"][0]["nodes"][0]]
    x, y, z, w = root["rotation"]
    up = so3.matrix_from_quaternion(torch.tensor([w, x, y, z])) @ torch.tensor([0.0, 0.0, 1.0])
    np.testing.assert_allclose(up, [0, 1, 0], atol=1e-6)
    (animation,) = document["animations"]
    tracks = {c["target"]["path"]: animation["samplers"][c["sampler"]] for c in animation["channels"]}
    steps = flown()
    np.testing.assert_allclose(arrays[tracks["rotation"]["input"]][:, 0], [step.time for step in steps], atol=1e-6)
    positions = torch.stack([step.truth.position for step in steps])
    np.testing.assert_allclose(arrays[tracks["translation"]["output"]], positions, atol=1e-6)
    xyzw = torch.from_numpy(arrays[tracks["rotation"]["output"]].copy())
    rotations = so3.matrix_from_quaternion(xyzw[:, [3, 0, 1, 2]])
    np.testing.assert_allclose(rotations, torch.stack([step.truth.rotation for step in steps]), atol=1e-6)


def test_the_robot_stands_at_its_first_pose_where_nothing_is_played() -> None:
    scene = trimesh.load(trimesh.util.wrap_as_stream(gltf(flight()).content), file_type="glb")
    assert isinstance(scene, trimesh.Scene)
    transform, _ = scene.graph["robot"]
    y_up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    np.testing.assert_allclose(transform[:3, 3], y_up @ flown()[0].truth.position.numpy(), atol=1e-6)
    np.testing.assert_allclose(transform[:3, :3], y_up @ flown()[0].truth.rotation.numpy(), atol=1e-6)
    document, _ = arrays_of(gltf(flight()).content)
    assert document["asset"]["extras"] == {"title": "a helix", "outcome": "collided"}


def test_another_reader_finds_the_paths_and_the_body_in_y_up_axes() -> None:
    scene = trimesh.load(trimesh.util.wrap_as_stream(gltf(flight()).content), file_type="glb")
    assert isinstance(scene, trimesh.Scene) and {"truth", "belief", "robot"} <= set(scene.graph.nodes_geometry)
    transform, name = scene.graph["truth"]
    line = trimesh.transform_points(scene.geometry[name].vertices, transform)
    truth = torch.stack([step.truth.position for step in flown()]).numpy()
    np.testing.assert_allclose(line, truth[:, [0, 2, 1]] * [1, 1, -1], atol=1e-6)


def test_the_body_is_a_closed_box_of_its_size() -> None:
    scene = trimesh.load(trimesh.util.wrap_as_stream(gltf(plan()).content), file_type="glb")
    assert isinstance(scene, trimesh.Scene)
    box = scene.geometry["robot"]
    assert isinstance(box, trimesh.Trimesh) and box.is_watertight and box.volume == pytest.approx(0.1 * 0.1 * 0.04)


def test_a_container_holds_what_was_put_into_it_and_other_bytes_are_refused() -> None:
    document = {"buffers": [{"byteLength": 5}], "asset": {"version": "2.0"}}
    assert parts(packed(document, b"12345")) == (document, b"12345")
    for broken in (b"", b"glTF", packed(document, b"12345")[:40]):
        with pytest.raises(InvalidInputError, match="no binary glTF"):
            parts(broken)
