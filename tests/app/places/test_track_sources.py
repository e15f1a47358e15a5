"""Videos and pictures that visitors bring to have their camera tracked."""

import io
import zipfile

import pytest

from nerfnav_app.places.uploads import TrackSources, UploadError


def zipped(*names: str) -> bytes:
    """An archive of such files."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name in names:
            archive.writestr(name, b"content")
    return stream.getvalue()


def test_a_video_is_kept_under_its_own_harmless_name() -> None:
    sources = TrackSources()
    path = sources.keep("../my walk.mp4", b"video")
    assert path.name == "my_walk.mp4" and path.read_bytes() == b"video"


def test_pictures_are_unpacked_and_found_below_a_folder_of_their_own() -> None:
    sources = TrackSources()
    folder = sources.keep("walk.zip", zipped("walk/rgb/1.000000.png", "walk/rgb.txt", "walk/virus.exe"))
    assert sorted(path.name for path in folder.iterdir()) == ["rgb", "rgb.txt"]
    again = sources.keep("walk.zip", zipped("1.000000.png"))
    assert again != folder and folder.is_dir() and [path.name for path in again.iterdir()] == ["1.000000.png"]


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("walk.exe", b"video", "no video and no zip"),
        ("walk.mp4", b"", "empty"),
        ("walk.zip", b"no zip", "no readable .zip"),
        ("walk.zip", zipped("../../1.000000.png"), "outside of its own folder"),
        ("walk.zip", zipped("notes.doc"), "no pictures"),
    ],
)
def test_what_cannot_be_tracked_is_refused_in_a_sentence(name: str, content: bytes, complaint: str) -> None:
    with pytest.raises(UploadError, match=complaint) as reported:
        TrackSources().keep(name, content)
    assert "/nerfnav-" not in str(reported.value)
