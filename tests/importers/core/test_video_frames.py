"""Videos: frames upright, with their own times, of files that are whole, cut off, or without a length."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.video_frames import count_frames, read_video

QUARTER_TURN = struct.pack(">9i", 0, 1 << 16, 0, -(1 << 16), 0, 0, 0, 0, 1 << 30)
"""Matrix of an MP4 track that is to be shown a quarter turn clockwise."""


def write_video(path: Path, frames: int = 20, size: tuple[int, int] = (64, 96)) -> Path:
    """A video whose upper left corner is white, at 10 frames a second."""
    kind = {".avi": "MJPG", ".mp4": "mp4v", ".mkv": "mp4v"}[path.suffix]
    height, width = size
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*kind), 10, (width, height))
    for index in range(frames):
        picture = np.full((height, width, 3), 2 * index, np.uint8)
        picture[: height // 3, : width // 3] = 255
        writer.write(picture)
    writer.release()
    return path


def turn(path: Path) -> Path:
    """Note in an MP4 file that its pictures are to be turned, as telephones do."""
    content = bytearray(path.read_bytes())
    matrix = content.index(b"tkhd") + 4 + 40
    content[matrix : matrix + 36] = QUARTER_TURN
    path.write_bytes(content)
    return path


def slow_down(path: Path, first: int) -> Path:
    """Let the frames of an MP4 file after the first ones last three times as long."""
    content = bytearray(path.read_bytes())
    at = content.index(b"stts") + 4
    entries, count, each = struct.unpack_from(">III", content, at + 4)
    assert entries == 1 and content.index(b"mdat") < at, "what follows the table may move"
    content[at + 4 : at + 16] = struct.pack(">5I", 2, first, each, count - first, 3 * each)
    for box in (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stts"):
        size = content.index(box) - 4
        content[size : size + 4] = struct.pack(">I", struct.unpack_from(">I", content, size)[0] + 8)
    content[content.index(b"edts") : content.index(b"edts") + 4] = b"free"  # it ends where the video ended
    path.write_bytes(content)
    return path


def trim(path: Path) -> Path:
    """Let the edit list of an MP4 file show its first half alone."""
    content = bytearray(path.read_bytes())
    at = content.index(b"elst") + 4 + 8
    content[at : at + 4] = struct.pack(">I", struct.unpack_from(">I", content, at)[0] // 2)
    path.write_bytes(content)
    return path


def lose_length(path: Path) -> Path:
    """Void the length in a Matroska file, which a recording that is streamed never has."""
    content = path.read_bytes()
    at = content.index(b"\x44\x89\x88")
    path.write_bytes(content[:at] + b"\xec\x89" + bytes(9) + content[at + 11 :])
    return path


@pytest.mark.parametrize("suffix", [".avi", ".mp4", ".mkv"])
def test_frames_come_with_their_times_and_the_share_of_the_video(suffix: str, tmp_path: Path) -> None:
    path = write_video(tmp_path / f"walk{suffix}")
    frames = list(read_video(path))
    assert count_frames(path) == 20 and [frame.index for frame in frames] == list(range(20))
    assert [frame.seconds for frame in frames] == pytest.approx([index / 10 for index in range(20)], abs=2e-3)
    assert [frame.fraction for frame in frames] == pytest.approx([index / 20 for index in range(20)], abs=0.01)
    assert [frame.index for frame in read_video(path, 7)] == [0, 7, 14]


def test_a_video_that_was_filmed_sideways_is_read_upright(tmp_path: Path) -> None:
    (frame, *_) = read_video(turn(write_video(tmp_path / "walk.mp4")))
    assert frame.pixels.shape == (96, 64, 3)
    corner = frame.pixels[:20, -15:].mean(), frame.pixels[:20, :15].mean()
    assert corner[0] > 200 > 50 > corner[1], "the upper left corner is the upper right one after a turn clockwise"


def test_frames_of_a_variable_rate_are_all_read_with_their_own_times(tmp_path: Path) -> None:
    frames = list(read_video(slow_down(write_video(tmp_path / "walk.mp4"), 10)))
    assert len(frames) == 20
    steps = np.diff([frame.seconds for frame in frames])
    assert steps[:10] == pytest.approx(np.full(10, 0.1), abs=1e-3)
    assert steps[10:] == pytest.approx(np.full(9, 0.3), abs=1e-3)


def test_a_recording_without_a_length_is_read_to_its_end(tmp_path: Path) -> None:
    path = lose_length(write_video(tmp_path / "walk.mkv"))
    frames = list(read_video(path))
    assert count_frames(path) is None and len(frames) == 20
    assert {frame.fraction for frame in frames} == {0.0}


def test_a_trimmed_video_is_whole(tmp_path: Path) -> None:
    path = trim(write_video(tmp_path / "walk.mp4"))
    assert len(list(read_video(path))) < 15
    path.write_bytes(path.read_bytes() + b"\0\0\1\0mdat")
    with pytest.raises(InvalidInputError, match="is cut off"):
        list(read_video(path))


def test_what_is_no_video_and_what_is_cut_off_are_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "page.mp4").write_bytes(b"<!doctype html><html></html>")
    with pytest.raises(InvalidInputError, match=r"page.mp4 cannot be read as a video: it is a web page"):
        next(read_video(tmp_path / "page.mp4"))
    (tmp_path / "empty.mov").write_bytes(b"")
    with pytest.raises(InvalidInputError, match="of another kind, empty, cut off, or of an unknown codec"):
        count_frames(tmp_path / "empty.mov")
    path = write_video(tmp_path / "walk.avi", 60)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    seen = []
    with pytest.raises(InvalidInputError, match=r"is cut off: it declares 60 frames \(6.0 s\), and \d+ \(\d.\d s\)"):
        seen.extend(read_video(path))
    assert 10 < len(seen) < 50
