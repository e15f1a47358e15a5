"""Cases of meshes: files of others that were read wrongly once, by the command that their README names."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nerfnav.importers.meshes.files import read_mesh
from nerfnav.importers.meshes.parts import Parts, join_parts
from nerfnav_app.cli import main as cli

CASES = Path(os.environ.get("NERFNAV_TEST_DATA", ".")) / "cases"
pytestmark = pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="NERFNAV_TEST_DATA is not set")


def joined(name: str) -> Parts:
    path = CASES / name
    return join_parts(read_mesh(path).parts, path)



def train(name: str, folder: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, Any]:
    """Exit code, and the report or the sentence, of the command."""
    words = ["--iterations", "1", "--images", "40", "--voxel", "0.1", "--json", *options]
    code = cli.main(["train", str(CASES / name), "--out", str(folder / "f.npz"), *words])
    captured = capsys.readouterr()
    return code, json.loads(captured.out.splitlines()[-1]) if code == 0 else captured.err.strip()


@pytest.mark.parametrize(
    ("name", "faces", "square_metres", "size"),
    [
        ("glb-triangle-fan/a.glb", 16, 158, [12, 2, 12]),
        ("glb-hidden-node/a.glb", 14, 150, [12, 1, 12]),
        ("glb-instancing/a.glb", 38, 162, [12, 1, 12]),
        ("glb-morph-weights/a.glb", 14, 158, [12, 3, 12]),
        ("glb-quantized-normalized/a.glb", 14, 168, [12, 2, 12]),
        ("obj-concave/a.obj", 4, 7, [4, 0, 4]),
        ("obj-map-options/a.obj", 2, 100, [10, 0, 10]),
        ("obj-two-mtllib/a.obj", 2, 100, [10, 0, 10]),
    ],
)
def test_what_a_file_holds_stands_in_the_world(name: str, faces: int, square_metres: float, size: list[float]):
    parts = joined(name)
    assert len(parts.faces) == faces
    assert parts.areas.sum() == pytest.approx(square_metres, abs=0.01)
    np.testing.assert_allclose(np.ptp(parts.bounds, axis=0), size, atol=0.001)


def test_three_instances_stand_at_minus_3_0_and_3():
    parts = joined("glb-instancing/a.glb")
    middles = {round(float(x), 3) for x in parts.vertices[parts.vertices[:, 1] > 0.5][:, 0]}
    assert middles == {-3.5, -2.5, -0.5, 0.5, 2.5, 3.5}


def test_textures_and_materials_have_their_colours():
    assert joined("obj-map-options/a.obj").paint.images[0][0, 0].tolist() == [255, 0, 0]
    assert joined("obj-two-mtllib/a.obj").paint.tint[0, 0].tolist() == [0, 255, 0]


@pytest.mark.slow
def test_the_command_trains_what_the_file_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    code, report = train("glb-instancing/a.glb", tmp_path, capsys)
    assert (code, report["source"]["faces"], report["source"]["size_m"]) == (0, 38, [12.0, 12.0, 1.0])


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("glb-asset-number/a.glb", "has a wrong value in its header, at asset: expected object, got float"),
        ("glb-buffer-index/a.glb", "bufferViews[1] names buffers[7], and there are 1"),
        ("glb-no-scenes/a.glb", "has no scene, so nothing of it stands anywhere: export it with a scene"),
        ("mesh-lfs-pointer/odm_textured_model.obj", "is a pointer of Git LFS in place of the file itself"),
        ("mesh-stray-part/room_outlier.glb", "12 faces (geometry_5) that are 3.436e+05 m away from the rest"),
        ("mesh-stray-part/room_outlier60.glb", "--box -3.35 -2.35 -0.35 3.35 2.35 3.3 leaves them out"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(
    name: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    code, said = train(name, tmp_path, capsys)
    assert code == cli.BAD_INPUT
    assert sentence in said and len(said.splitlines()) == 1


def test_a_stray_part_is_left_out_by_the_box_that_is_offered(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    box = ["--box", "-3.35", "-2.35", "-0.35", "3.35", "2.35", "3.30"]
    code, report = train("mesh-stray-part/room_outlier.glb", tmp_path, capsys, *box)
    assert (code, report["source"]["faces"], report["source"]["size_m"]) == (0, 60, [6.1, 4.1, 3.05])
