"""PLY, STL, OFF and Collada: polygons and spellings."""

import struct
from pathlib import Path

import pytest
from PIL import Image

from nerfnav.importers.core.errors import MeshFileError
from nerfnav.importers.meshes.files import read_mesh
from nerfnav.importers.meshes.parts import Parts, join_parts
from tests.importers.meshes.places import quad, write_collada

L_SHAPE = [(4, 0), (4, 1), (1, 1), (1, 4), (0, 4), (0, 0)]
"""Corners of a concave polygon of 7 m^2; a fan around the first of them would give 16."""


def read(path: Path, data: bytes | str) -> Parts:
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return join_parts(read_mesh(path).parts, path)



def ply(form: str, faces: list[list[int]], newline: str = "\n") -> bytes:
    """The polygons between the corners of the L, with colours of faces, as a PLY file."""
    lines = [
        "ply", f"format {form} 1.0", "comment made here", f"element vertex {len(L_SHAPE)}", "property float x",
        "property double y", "property float z", f"element face {len(faces)}", "property uchar flags",
        "property list uchar int vertex_indices", "property uchar red", "property uchar green", "property uchar blue",
        "end_header", "",
    ]  # fmt: skip
    head = newline.join(lines).encode()
    if form == "ascii":
        rows = [f"{x} {y} 0" for x, y in L_SHAPE]
        rows += [f"7 {len(face)} {' '.join(map(str, face))} 0 255 0" for face in faces]
        return head + newline.join(rows).encode()
    order = "<" if "little" in form else ">"
    body = b"".join(struct.pack(f"{order}fdf", x, y, 0) for x, y in L_SHAPE)
    for face in faces:
        body += struct.pack(f"{order}BB{len(face)}iBBB", 7, len(face), *face, 0, 255, 0)
    return head + body


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("faces", [[[0, 1, 2, 3, 4, 5]], [[0, 1, 2, 5], [5, 2, 3, 4]], [[0, 1, 2], [0, 2, 3, 4, 5]]])
def test_polygons_of_a_ply_in_any_byte_order(tmp_path: Path, form: str, newline: str, faces: list[list[int]]):
    parts = read(tmp_path / "A.PLY", ply(form, faces, newline))
    assert parts.areas.sum() == pytest.approx(7.0)
    assert {tuple(color) for color in parts.paint.tint.reshape(-1, 3).tolist()} == {(0, 255, 0)}


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_a_ply_with_an_impossible_list_or_corner_is_one_sentence(tmp_path: Path, form: str):
    with pytest.raises(MeshFileError, match="corner that does not exist: vertex 9 of 6"):
        read(tmp_path / "a.ply", ply(form, [[0, 1, 9]]))
    with pytest.raises(MeshFileError, match="is cut off: its 2 rows of 'face' are not all there"):
        read(tmp_path / "a.ply", ply(form, [[0, 1, 2], [3, 4, 5]])[:-12])
    with pytest.raises(MeshFileError, match=r"a line in its header that makes no sense: 'element vertex many'"):
        read(tmp_path / "a.ply", ply(form, [[0, 1, 2]]).replace(b"vertex 6", b"vertex many"))


def test_strips_of_a_ply_are_triangles(tmp_path: Path):
    head = ply("ascii", [[0, 1, 2]]).decode().partition("element face")[0]
    rows = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n9 9 9\n9 9 9\n8 0 1 2 3 -1 0 1 2\n"
    text = f"{head}element tristrips 1\nproperty list int int vertex_indices\nend_header\n{rows}"
    assert read(tmp_path / "a.ply", text).areas.sum() == pytest.approx(1.5)


def test_a_texture_of_a_ply_is_shown_by_the_coordinates_of_its_corners(tmp_path: Path):
    Image.new("RGB", (2, 2), (9, 8, 7)).save(tmp_path / "t.png")
    text = (
        "ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_index\nproperty list uchar float texcoord\n"
        "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 0.5 0 0 0.5\n"
    )
    parts = read(tmp_path / "a.ply", text)
    assert parts.paint.images[0][0, 0].tolist() == [9, 8, 7]
    assert parts.paint.uv[0].tolist() == [[0, 0], [0.5, 0], [0, 0.5]]


@pytest.mark.parametrize("change", [str, str.upper, lambda text: "\ufeff" + text.replace("\n", "\r\n"), str.title])
def test_an_stl_in_text_may_be_in_capitals(tmp_path: Path, change):
    loop = "facet normal 0 0 1\nouter loop\nvertex {}\nvertex {}\nvertex {}\nendloop\nendfacet\n"
    loops = loop.format("0 0 0", "2e0 0 0", "0 1 0") + loop.format("0 0 1", "1 0 1", "0 1 1")
    parts = read(tmp_path / "A.STL", change(f"solid a\n{loops}endsolid a\n"))
    assert parts.areas.sum() == pytest.approx(1.5)


def test_an_off_file_has_polygons_colours_and_comments(tmp_path: Path):
    rows = "\n".join(f"{x} {y} 0  # a corner" for x, y in L_SHAPE)
    parts = read(tmp_path / "a.off", f"OFF\n# made here\n6 1 0\n{rows}\n6 0 1 2 3 4 5\n")
    assert parts.areas.sum() == pytest.approx(7.0)
    text = "COFF 3 1 0\n0 0 0 0 255 0 255\n1 0 0 0 255 0 255\n0 1 0 0 255 0 255\n3 0 1 2 9 9 9\n"
    parts = read(tmp_path / "a.OFF", text)
    assert parts.paint.tint.reshape(-1, 3).tolist() == [[0, 255, 0]] * 3


@pytest.mark.parametrize(
    "text",
    ["OFF\n3 1 0\n0 0 0\n1 0 0\n", "OFF\nx\n", "OFF\n", "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "OFF BINARY\n"],
)
def test_an_off_file_that_is_not_whole_is_one_sentence(tmp_path: Path, text: str):
    with pytest.raises(MeshFileError) as caught:
        read(tmp_path / "a.off", text)
    assert "\n" not in str(caught.value)


def test_a_concave_polygon_of_collada_keeps_its_notch(tmp_path: Path):
    path = write_collada([(quad(-1, 1), (9, 9, 9))], tmp_path / "a.dae")
    text = path.read_text()
    points = " ".join(f"{x} {y} 0" for x, y in L_SHAPE)
    corners = "-1 -1 0 1 -1 0 1 1 0 -1 1 0"
    assert corners in text
    text = text.replace(f'count="12">{corners}', f'count="18">{points}')
    text = text.replace('count="4" stride="3"', 'count="6" stride="3"')
    before, _, rest = text.partition("<triangles count=\"2\"")
    inside, _, after = rest.partition("<p>")
    after = after.partition("</triangles>")[2]
    faces = " ".join(f"{corner} 0" for corner in range(6))
    path.write_text(f'{before}<polylist count="1"{inside}<vcount>6</vcount><p>{faces}</p></polylist>{after}')
    assert join_parts(read_mesh(path).parts, path).areas.sum() == pytest.approx(7.0)
