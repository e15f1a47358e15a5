"""Files of obstacles: YAML and JSON, and one sentence with the key's path for each that is impossible."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav.obstacles import (
    BoxShape,
    Cylinder,
    MeshShape,
    Obstacle,
    ObstacleSet,
    Prism,
    Trefoil,
    read_obstacles,
    write_obstacles,
)

YAML = """
obstacles:
  - {name: crate, box: [0.4, 0.4, 8e-1], position: [1, 0, 0.4], rotation: [0, 0, 0.5], color: [0.8, 0.3, 0.1]}
  - {sphere: 0.3, position: [0, 0, 1], motion: {velocity: [0.2, 0, 0], max_speed: 0.2}}
  - {name: post, cylinder: {radius: 0.1, height: 2}, motion: {walk: {lower: [0, 0, 0], upper: [1, 1, 0], speed: 0.4}}}
  - {name: wall, prism: {polygon: [[0, 0], [2, 0], [2, 0.1]], heights: [0, 1.5]}}
  - {name: chair, mesh: chair.stl, motion: {trefoil: {scale: [3, 3, 3], slower: 5}}}
  - {name: cart, box: [1, 1, 1], motion: {way_points: {points: [[0, 0, 0], [2, 0, 0]], speed: 1}}, seen: on}
"""


def test_yaml_and_json_are_read_alike(tmp_path: Path) -> None:
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "chair.stl")
    (tmp_path / "a.yaml").write_text(YAML)
    import yaml

    (tmp_path / "a.json").write_bytes(json.dumps(yaml.safe_load(YAML.replace("8e-1", "0.8"))).encode("utf-16"))
    points = np.random.default_rng(0).uniform(-3, 3, (50, 3))
    for time in (0.0, 7.5):
        first, second = (read_obstacles(tmp_path / name) for name in ("a.yaml", "a.json"))
        np.testing.assert_array_equal(first.signed_distance(points, time), second.signed_distance(points, time))
    crate, ball, post, wall, chair, cart = first.obstacles
    assert first.standing == (crate, wall) and first.announced == (ball, post, chair) and first.moving[-1] is cart
    assert crate.name == "crate" and crate.position == (1, 0, 0.4) and crate.color == (0.8, 0.3, 0.1)
    assert ball.name == "obstacle 2" and ball.motion.speed_bound == pytest.approx(0.2)
    assert isinstance(post.shape, Cylinder) and isinstance(wall.shape, Prism) and isinstance(chair.shape, MeshShape)
    assert isinstance(chair.motion, Trefoil) and chair.shape.surface.extents.tolist() == [1, 2, 3]


@pytest.mark.parametrize("name", ["kept.json", "kept.yaml"])
def test_what_is_written_is_read_again(name: str, tmp_path: Path) -> None:
    trimesh.creation.icosphere(subdivisions=1, radius=0.7).export(tmp_path / "chair.stl")
    stone = "  - {name: stone, cut_out: {box: [1, 1, 2], position: [0, 0, 1]}, position: [2, 0, 1]}\n"
    (tmp_path / "a.yaml").write_text(YAML + stone)
    given, kept = read_obstacles(tmp_path / "a.yaml"), tmp_path / "kept"
    kept.mkdir()
    assert [path.name for path in write_obstacles(given, kept / name)] == [name, "kept-5.ply"]
    again, points = read_obstacles(kept / name), np.random.default_rng(0).uniform(-3, 3, (50, 3))
    for first, second in zip(given.obstacles, again.obstacles, strict=True):
        assert (first.name, first.position, first.rotation, first.color, first.motion, first.seen) == (
            second.name, second.position, second.rotation, second.color, second.motion, second.seen,
        )  # fmt: skip
        for time in (0.0, 7.5):
            far = 1e-6 if isinstance(first.shape, MeshShape) else 0.0  # corners are stored in single precision
            np.testing.assert_allclose(
                first.signed_distance(points, time), second.signed_distance(points, time), atol=far, rtol=0
            )


class Unknown:
    """A shape and a motion that files do not have."""

    speed_bound = 0.0

    def offset(self, times: np.ndarray) -> np.ndarray:
        return np.zeros((len(times), 3))

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        return np.zeros(len(points))

    def support(self, directions: np.ndarray) -> np.ndarray:
        return np.zeros(len(directions))

    def mesh(self) -> trimesh.Trimesh:
        return trimesh.creation.box()


def test_shapes_and_motions_that_files_do_not_have_are_refused(tmp_path: Path) -> None:
    cube = BoxShape((1, 1, 1))
    for unknown in (Obstacle("a", Unknown(), (0, 0, 0)), Obstacle("a", cube, (0, 0, 0), motion=Unknown())):
        with pytest.raises(InvalidInputError, match="a Unknown cannot be written: files have"):
            write_obstacles(ObstacleSet((unknown,)), tmp_path / "b.json")
    assert not (tmp_path / "b.json").exists()


WRONG = {
    "obstacles: [{box: [0, 1, 1]}]": r"obstacles\[0\].box\[0\] is 0, a number at least 0.001 is needed",
    "obstacles: [{box: [.nan, 1, 1]}]": r"obstacles\[0\].box\[0\] is NaN",
    "obstacles: [{sphere: .inf}]": r"obstacles\[0\].sphere is infinite",
    "obstacles: [{sphere: -1}]": r"obstacles\[0\].sphere is -1",
    "obstacles: [{sphere: 1, position: [1e9, 0, 0]}]": r"obstacles\[0\].position\[0\] is",
    "obstacles: [{box: [1, 1]}]": r"obstacles\[0\].box is a list of 2",
    "obstacles: []": "obstacles has 0 entries, 1 to 1000 are needed",
    "obstacles: [{}]": r"obstacles\[0\]: an obstacle is one of box, .*has none",
    "obstacles: [{sphere: 1}, {box: [1, 1, 1], sphere: 2}]": r"obstacles\[1\]: an obstacle is one of .* box and sphere",
    "obstacles: [{sphere: 1, sized: 2}]": r"obstacles\[0\] has the key sized, which the format does not have",
    "obstacles: [{sphere: 1, motion: {velocity: [1, 0, 0], max_speed: 0.5}}]": "reaches 1 m/s.* max_speed of 0.5 m/s",
    "obstacles: [{sphere: 1, motion: {trefoil: {scale: [4, 4, 4], slower: 4}, max_speed: 1}}]": "max_speed of 1 m/s",
    "obstacles: [{sphere: 1, motion: {way_points: {points: [[0, 0, 0]], speed: 1}}}]": r"way_points.points is a list",
    "obstacles: [{sphere: 1, motion: {way_points: {points: [[0, 0, 0], [1, 0, 0]], speed: 0}}}]": "speed is 0",
    "obstacles: [{mesh: no.stl}]": r"obstacles\[0\]: there is no mesh",
    "obstacles: [{mesh: open.stl}]": r"obstacles\[0\]: the mesh of an obstacle is open",
    "obstacles: [{mesh: text.stl}]": "must have triangles, and this one has none",
    "obstacles: [{prism: {polygon: [[0, 0], [1, 1], [1, 0], [0, 1]], heights: [0, 1]}}]": "crosses itself",
    "obstacles: [{prism: {polygon: [[0, 0], [1, 0], [1, 1]], heights: [1, 0]}}]": "the lower and then the upper",
    "obstacles: [{sphere: 1, color: [200, 0, 0]}]": r"obstacles\[0\].color\[0\] is 200, a number at most 1",
    "obstacles: [{sphere: 1, name: a}, {sphere: 1, name: a}]": "two obstacles are named 'a'",
    "obstacles: [" + "{sphere: 1}, " * 10_000 + "]": "obstacles has 10000 entries",
    "obstacles: [{cut_out: {sphere: 1}, seen: true}]": r"obstacles\[0\] is a cut_out that is seen alone",
    "obstacles: [{cut_out: {sphere: 1}, motion: {velocity: [1, 0, 0]}}]": r"obstacles\[0\] is a cut_out that moves",
    "obstacles: 3": "obstacles is 3, a list is needed",
    "": "holds no names with values",
    "obstacles: [{sphere: 1": "not readable as YAML",
    "obstacles: [{sphere: 1}]\n---\nobstacles: [{sphere: 1}]": "has 2 documents",
}


@pytest.mark.parametrize("text", WRONG, ids=lambda text: text[:60])
def test_an_impossible_obstacle_is_one_sentence(text: str, tmp_path: Path) -> None:
    box = trimesh.creation.box((1, 1, 1))
    box.update_faces(np.arange(12) > 0)
    box.export(tmp_path / "open.stl")
    (tmp_path / "text.stl").write_text("no mesh")
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(InvalidInputError, match=WRONG[text]) as raised:
        read_obstacles(tmp_path / "a.yaml")
    assert "\n" not in str(raised.value) and str(tmp_path) in str(raised.value)
