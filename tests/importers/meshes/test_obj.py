"""Wavefront OBJ: polygons, materials and textures as programs write them."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from nerfnav.importers.core.errors import MeshFileError
from nerfnav.importers.meshes.files import MeshFile, read_mesh
from nerfnav.importers.meshes.parts import Parts, join_parts

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
RED, GREEN = (255, 0, 0), (0, 255, 0)


def read(folder: Path, text: str | bytes, name: str = "a.obj", **libraries: str) -> tuple[Parts, MeshFile]:
    """The mesh of a text; libraries are materials by the stem of their file."""
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    for stem, content in libraries.items():
        (folder / f"{stem}.mtl").write_text(content)
    file = read_mesh(path)
    return join_parts(file.parts, path), file



def tints(parts: Parts) -> set[tuple[int, ...]]:
    return {tuple(color) for color in parts.paint.tint.reshape(-1, 3).tolist()}


def picture(folder: Path, name: str) -> None:
    (folder / name).parent.mkdir(exist_ok=True)
    Image.new("RGB", (2, 2), RED).save(folder / name)


@pytest.mark.parametrize("shift", range(6))
@pytest.mark.parametrize("turned", [False, True])
def test_concave_polygons_keep_their_notch_whichever_corner_comes_first(tmp_path: Path, shift: int, turned: bool):
    corners = np.roll([1, 2, 3, 4, 5, 6], shift)[:: -1 if turned else 1]
    points = "v 0 0 0\nv 4 0 0\nv 4 0 1\nv 1 0 1\nv 1 0 4\nv 0 0 4\n"
    parts, _ = read(tmp_path, f"{points}f {' '.join(map(str, corners))}\n")
    assert parts.areas.sum() == pytest.approx(7.0)
    triangles = parts.vertices[parts.faces]
    direction = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[:, 1]
    assert (direction > 0).all() if turned else (direction < 0).all()


def test_a_concave_quad_keeps_its_notch(tmp_path: Path):
    parts, _ = read(tmp_path, "v 0 0 0\nv 2 2 0\nv 0 1 0\nv -2 2 0\nf 1 2 3 4\n")
    assert parts.areas.sum() == pytest.approx(2.0)


@pytest.mark.parametrize(
    "text",
    [
        SQUARE + "F 1 2 3 4\n",
        SQUARE.replace("v ", "V ").replace("vt ", "VT ") + "f -4/-4 -3/-3 -2/-2 -1/-1\n",
        SQUARE + "f 1/1/1 2/2/1 \\\n 3/3/1 4//1 # a comment\n",
        (SQUARE + "f 1//1 2//1 3//1 4//1").replace("\n", "\r\n"),
        (SQUARE + "f 1 2 3 4").replace("\n", "\r"),
        "\ufeff" + SQUARE.replace(" ", "\t ") + "f\t1\t2\t3\t4",
        (SQUARE + "f 1 2 3 4").encode("utf-16"),
        "o größe\n".encode("latin-1") + (SQUARE + "f 1 2 3\nf 1 3 4\nf 1 2\n").encode(),
        SQUARE.replace("v 0 0 0", "v 0 0 0 1.0") + "f 1 2 3 4\nl 1 2\np 1\n",
    ],
)  # fmt: skip
def test_a_square_is_a_square_in_every_spelling(tmp_path: Path, text: str | bytes):
    parts, _ = read(tmp_path, text, "A.OBJ")
    assert parts.areas.sum() == pytest.approx(1.0)
    assert len(parts.vertices) == 4


@pytest.mark.parametrize("line", ["mtllib m.mtl n.mtl", "mtllib m.mtl\nMTLLIB n.mtl", 'mtllib "m.mtl" "n.mtl"'])
def test_materials_come_from_all_libraries(tmp_path: Path, line: str):
    text = f"{line}\n{SQUARE}usemtl k\nf 1 2 3 4\n"
    parts, _ = read(tmp_path, text, m="newmtl m\nKd 1 0 0\n", n="newmtl k\nkd 0 1 0\n")
    assert tints(parts) == {GREEN}


def test_libraries_and_materials_may_have_spaces_in_their_names(tmp_path: Path):
    (tmp_path / "my walls.mtl").write_text("newmtl green paint\nKd 0 1 0\n")
    parts, _ = read(tmp_path, f"mtllib my walls.mtl\n{SQUARE}usemtl green paint\nf 1 2 3 4\n")
    assert tints(parts) == {GREEN}


@pytest.mark.parametrize(
    "line",
    [
        "map_Kd t.png",
        "MAP_KD -s 1 1 1 t.png",
        "map_Kd -o 0.5 0 -s 2 2 -bm 0.5 -clamp on -blendu off t.png",
        "map_Kd -s 2 t.png",
        "map_Kd -imfchan r -texres 512 -mm 0 1 -t 0.1 0.1 0.1 t.png",
        r"map_Kd C:\Users\me\textures\t.png",
        "map_Kd /home/me/t.png",
        "map_Kd T.PNG",
    ],
)
def test_options_and_foreign_paths_of_a_texture_do_not_hide_it(tmp_path: Path, line: str):
    picture(tmp_path, "t.png")
    parts, file = read(tmp_path, f"mtllib m.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3 4/4\n", m=f"newmtl m\n{line}\n")
    assert [image[0, 0].tolist() for image in parts.paint.images] == [list(RED)]
    assert (parts.paint.image_of_face == 0).all()
    assert not [note for note in file.notes if "grey" in note]


@pytest.mark.parametrize("name", ["my t.png", "1.png", "sub/t 2.png"])
def test_textures_may_have_spaces_and_numbers_in_their_names(tmp_path: Path, name: str):
    picture(tmp_path, name)
    text = f"mtllib m.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3 4/4\n"
    parts, _ = read(tmp_path, text, m=f"newmtl m\nmap_Kd -s 2 2 {name}\n")
    assert len(parts.paint.images) == 1


def test_scale_and_offset_of_a_texture_move_its_coordinates(tmp_path: Path):
    picture(tmp_path, "t.png")
    text = f"mtllib m.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3 4/4\n"
    parts, _ = read(tmp_path, text, m="newmtl m\nmap_Kd -s 2 3 -o 0.25 0.5 t.png\n")
    corners = {tuple(row) for row in parts.paint.uv.reshape(-1, 2).round(4).tolist()}
    assert corners == {(0.25, 0.5), (2.25, 0.5), (2.25, 3.5), (0.25, 3.5)}


def test_what_is_missing_is_grey_and_said(tmp_path: Path):
    text = f"mtllib m.mtl gone.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3 4/9\nusemtl other\nf 1 2 3\n"
    parts, file = read(tmp_path, text, m="newmtl m\nmap_Kd gone.png\n")
    assert tints(parts) == {(178, 178, 178)}
    for part in ("gone.mtl, which is not beside it", "gone.png is missing", "1 corners", "have no other"):
        assert any(part in note for note in file.notes)


def test_colours_of_vertices_are_from_0_to_1_or_bytes(tmp_path: Path):
    for one in (1, 255):
        text = "".join(f"v {x} {y} 0 0 {one} 0\n" for x, y in ((0, 0), (1, 0), (1, 1)))
        assert tints(read(tmp_path, text + "f 1 2 3\n")[0]) == {GREEN}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("v 0 0\nf 1 1 1\n", r"line 1, `v 0 0`, has not 3 numbers"),
        ("v 0 0 0\nv 1 x 0\nf 1 1 1\n", r"line 2, `v 1 x 0`"),
        ("v 0 0 0\nf 1 2 1\n", "line 2 names vertex 2, and there are 1"),
        ("v 0 0 0\nf 0 1 1\n", "line 2 names vertex 0"),
        ("v 0 0 0\nf -2 1 1\n", "line 2 names vertex -2"),
        ("v 0 0 0\nf 1 a 1\n", "line 2 has the corner 'a', no whole number"),
        (f"v 0 0 0\nf 1 {10**30} 1\n", "no whole number"),
        ("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "no finite numbers"),
        ("v 0 0 0\nv 1 0 0\n", "holds no faces"),
        ("hello\n", "no line that gives a vertex"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path: Path, text: str, sentence: str):
    with pytest.raises(MeshFileError, match=sentence):
        read(tmp_path, text)
