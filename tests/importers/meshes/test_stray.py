"""Stray parts: found by size and distance, named with the boxes that leave them out or keep them."""

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from nerfnav.importers.core.errors import StrayPartsError
from nerfnav.importers.core.placement import Placement
from nerfnav.importers.meshes.config import SceneConfig
from tests.importers.meshes.places import imported, quad, write


def room(folder: Path, *far: tuple[float, float, float], suffix: str = ".glb", size: float = 1.0) -> Path:
    """A floor of 6 x 4 m with a table, and boxes elsewhere; `size` scales all of it."""
    scene = trimesh.Scene()
    for name, extents, middle in (("floor", (6, 4, 0.1), (0, 0, 0)), ("table", (1, 1, 1), (1, 1, 0.5))):
        scene.add_geometry(_box(extents, middle), node_name=name, geom_name=name)
    for number, middle in enumerate(far):
        scene.add_geometry(_box((0.3, 0.3, 0.3), middle), node_name=f"far {number}", geom_name=f"far {number}")
    scene.apply_scale(size)
    return write(scene if suffix == ".glb" else scene.to_mesh(), folder / f"room{suffix}")


def _box(extents: tuple[float, ...], middle: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(extents, transform=trimesh.transformations.translation_matrix(middle))


def up_z(box: list[float] | None = None) -> SceneConfig:
    corners = None if box is None else (tuple(box[:3]), tuple(box[3:]))
    return SceneConfig(Placement(up=(0, 0, 1), scale=1.0, box=corners))  # type: ignore[arg-type]


def refusal(path: Path) -> str:
    with pytest.raises(StrayPartsError) as caught:
        imported(path, up_z())
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("size", [0.1, 1.0, 50.0])
@pytest.mark.parametrize("suffix", [".glb", ".stl"])
def test_a_part_is_stray_by_the_size_of_its_place_and_not_by_metres(tmp_path: Path, size: float, suffix: str):
    assert imported(room(tmp_path, (0, 0, 10.0), suffix=suffix, size=size), up_z()).report["faces"] == 36
    assert "has 12 faces" in refusal(room(tmp_path, (0, 0, 25.0), suffix=suffix, size=size))


def test_the_sentence_names_the_parts_their_distance_and_both_sizes(tmp_path: Path):
    sentence = refusal(room(tmp_path, (0, 0, 60), (0, 90, 0)))
    assert "has 24 faces (far 0, far 1) that are 58.85 m away from the rest" in sentence
    assert "without them it is 6 x 4 x 1.05 m large, with them 6 x 92.15 x 60.3 m" in sentence


def test_the_boxes_that_are_offered_do_what_they_say(tmp_path: Path):
    path = room(tmp_path, (0, 0, 60))
    without, with_all = ([float(x) for x in found.split()] for found in re.findall(r"--box ([-\d. ]+)", refusal(path)))
    small, large = imported(path, up_z(without)), imported(path, up_z(with_all))
    assert (small.report["faces"], large.report["faces"]) == (24, 36)
    np.testing.assert_allclose(np.ptp(small.scene.mesh.vertices, axis=0), [6, 4, 1.05], atol=1e-4)
    assert any("left out, outside of the box: 12 faces (far 0)" in str(guess) for guess in small.report["guesses"])  # type: ignore[union-attr]


def test_a_part_beyond_all_sizes_does_not_decide_the_unit_and_cannot_be_kept(tmp_path: Path):
    path = room(tmp_path, (0, 0, 343582))
    with pytest.raises(StrayPartsError, match=r"without them it is 6 x 1\.05 x 4 m large") as caught:
        imported(path, SceneConfig(Placement(up=(0, 1, 0))))
    assert "keeps them" not in str(caught.value)


def test_two_places_of_like_size_and_a_place_with_a_tower_have_no_stray_parts(tmp_path: Path):
    both = trimesh.Scene([quad(-1, 1), quad(20, 22)])
    tower = trimesh.Scene([quad(-1, 1), _box((0.1, 0.1, 40), (0, 0, 20))])
    for name, scene in (("both", both), ("tower", tower)):
        imported(write(scene, tmp_path / f"{name}.glb"), up_z())
