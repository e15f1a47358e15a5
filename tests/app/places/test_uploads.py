"""Files that visitors bring."""

import pytest

from nerfnav_app.places import uploads
from nerfnav_app.places.sources import title_of, without_folder
from nerfnav_app.places.uploads import UploadError, check_upload, safe_name


@pytest.mark.parametrize(
    ("name", "safe"),
    [
        ("house.glb", "house.glb"),
        ("../../etc/passwd.glb", "passwd.glb"),
        ("C:\\places\\my house.glb", "my_house.glb"),
        ("...hidden.ply", "hidden.ply"),
        ("", "upload"),
        ("..", "upload"),
        ("a\0b;rm -rf.obj", "a_b_rm_-rf.obj"),
        (200 * "x" + ".npz", 76 * "x" + ".npz"),
    ],
)
def test_names_cannot_lead_out_of_the_folder(name: str, safe: str) -> None:
    assert safe_name(name) == safe


@pytest.mark.parametrize(
    ("name", "content", "reason"), [("a.exe", b"MZ", "no kind"), ("a.glb", b"", "empty"), ("a.glb", b"123", "larger")]
)
def test_what_cannot_be_opened_is_refused_with_the_reason(
    name: str, content: bytes, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "MOST_BYTES", 2)
    with pytest.raises(UploadError, match=reason):
        check_upload(name, content)


def test_visitors_are_not_told_where_files_lie() -> None:
    assert title_of("/srv/places/a.glb") == "a.glb" and title_of("stonehenge") == "stonehenge"
    assert without_folder("/srv/places/a.glb has no faces", "/srv/places/a.glb") == "a.glb has no faces"
    assert without_folder("no scene/field x", "x") == "no scene/field x"
