"""Ground truth that is moved with its field."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.world.raycast import MeshRenderer
from nerfnav.world.scene import move_scene
from nerfnav.world.task import Task
from tests.field.moves import change
from tests.importers.meshes.places import ABOVE, CAMERA, UP_Z, imported, two_textures, write


def test_a_moved_camera_sees_the_moved_mesh_as_it_was(tmp_path: Path) -> None:
    scene = imported(write(two_textures(), tmp_path / "place.glb"), UP_Z).scene
    similarity = change((0.3, -0.2, 0.5), scale=2.0, shift=0.7)
    moved = move_scene(scene, similarity, similarity.box(scene.box))
    before = MeshRenderer(scene).render(CAMERA, ABOVE)
    now = MeshRenderer(moved).render(CAMERA, similarity.pose(ABOVE))
    differs = (before.image.int() - now.image.int()).abs().amax(-1) > 8
    assert differs.float().mean() < 0.01  # edges fall on other pixels
    assert moved.voxel == pytest.approx(2 * (scene.voxel or 0))
    if scene.solids:
        assert moved.solids[0].volume == pytest.approx(8 * scene.solids[0].volume)


def test_scenes_with_tasks_stay_where_they_are(tmp_path: Path) -> None:
    scene = imported(write(two_textures(), tmp_path / "place.glb"), UP_Z).scene
    task = replace(scene, tasks=(Task("there", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),))
    with pytest.raises(InvalidInputError, match="tasks"):
        move_scene(task, change(scale=2.0), scene.box)
    assert torch.isfinite(scene.box.lower).all()
