"""Header of PLY files: one parser for meshes and splats."""

import pytest

from nerfnav.importers.core.ply_header import PlyElement, PlyHeaderError, PlyProperty, parse_ply_header

HEAD = "ply\nformat binary_big_endian 1.0\ncomment TextureFile a b.png\nELEMENT Vertex 2\nproperty float32 X\n"


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_names_types_textures_and_size_are_read(newline: str) -> None:
    data = f"{HEAD}element face 1\nproperty list uchar int vertex_indices\nend_header\n".replace("\n", newline).encode()
    header = parse_ply_header(data + b"\0\1\2end_header\n")
    assert (header.form, header.order, header.size) == ("binary_big_endian", ">", len(data))
    assert header.textures == ["a b.png"]
    assert header.elements == [
        PlyElement("vertex", 2, [PlyProperty("x", "f4")]),
        PlyElement("face", 1, [PlyProperty("vertex_indices", "i4", "u1")]),
    ]


@pytest.mark.parametrize(("data", "message"), [
    (b"", "is not a PLY file"),
    (HEAD.encode(), "its header is cut off"),
    (b"ply\nformat pdf 1.0\nend_header\n", "of the format 'pdf'; PLY has ascii"),
    (b"ply\nproperty float x\nend_header\n", "a line in its header that makes no sense: 'property float x'"),
    (b"ply\nelement vertex -1\nend_header\n", "makes no sense: 'element vertex -1'"),
    (b"ply\nelement vertex 1\nproperty half x\nend_header\n", "makes no sense: 'property half x'"),
])  # fmt: skip
def test_a_damaged_header_is_the_end_of_a_sentence(data: bytes, message: str) -> None:
    with pytest.raises(PlyHeaderError, match=message):
        parse_ply_header(data)
