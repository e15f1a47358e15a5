"""Exports of the golden runs, taken apart as far as other people's libraries decide how they are packed.

Most formats are compared byte for byte as they are. MCAP is compressed by zstandard, and a rosbag2 is an SQLite
database with the times of its files in a zip: of these, every record, every row and every name is compared, and the
packed bytes too wherever the libraries that pack them are of the versions that wrote the golden ones.
"""

import hashlib
import io
import json
import math
import re
import sqlite3
import tempfile
import zipfile
import zlib
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from tests.golden import product as p

DATUM = (47.3977, 8.5456, 488.0)
"""Where on Earth the golden room is."""
KEPT_BYTES = 40_000
"""Files up to this size are kept whole; of larger ones their digests are."""
ESTIMATE = "estimate"
"""Recording of the flight's estimate, for the formats that hold nothing else."""
_BAG = "nerfnav_bag"
_NUMBER = re.compile(r"(-?[0-9]+(?:[.][0-9]+)?(?:e[+-]?[0-9]+)?)")


def recordings(data: Path, field: Any) -> dict[str, p.Recording]:
    """The recordings that are exported, read from the golden runs."""
    folder = data / "runs" / "flight"
    flight = replace(p.read_run(folder), datum=DATUM)
    estimate = replace(p.read_run(folder, p.Subject.ESTIMATE), datum=DATUM)
    plan = replace(p.read_run(data / "plan"), datum=DATUM, title="a plan")
    return {"flight": flight, "plan": plan.with_field(field), "plan without a field": plan, ESTIMATE: estimate}


def wanted(recording: p.Recording) -> dict[str, Any]:
    """The formats that a recording can be exported in, by name."""
    return {name: form for name, form in p.FORMATS.items() if recording.steps or not form.flights_only}


def exported(found: dict[str, p.Recording], title: str, form: Any) -> p.Exported:
    """Export a recording, of a flight the executed path where the format can hold it."""
    holds = found[title].subject in form.subjects
    return form.exported(found[title if holds else ESTIMATE], force=True, smooth=True)


def parts_of(name: str, content: bytes) -> dict[str, bytes]:
    """What an export consists of, without what only tells how, when and by which version it was packed."""
    if name == "mcap":
        return _records(content)
    if name == "rosbag2":
        return _bag(content)
    return {"content": content}


def sizes_of(digests: dict[str, str]) -> dict[str, int]:
    """Bytes of each part, from its digest."""
    return {part: int(digest.split()[1]) for part, digest in digests.items()}


def same_text(golden: bytes, now: bytes) -> bool:
    """Whether two texts are alike but for the last digits of their numbers, as another processor may round them."""
    try:
        one, other = (_NUMBER.split(text.decode()) for text in (golden, now))
    except UnicodeDecodeError:
        return golden == now
    pairs = zip(one, other, strict=False)
    alike = all(
        a == b or (index % 2 == 1 and math.isclose(float(a), float(b), rel_tol=1e-6, abs_tol=1e-6))
        for index, (a, b) in enumerate(pairs)
    )
    return len(one) == len(other) and alike


def others(data: Path, folder: Path) -> dict[str, bytes]:
    """Contents of what is not exported from a run: maps of the room, the text of a track, messages to a vehicle."""
    found = {}
    for ending in (".npz", ".glb", ".pgm"):
        p.printed_by_main(["map", str(data / "fields" / "room.npz"), "--out", str(folder / f"map{ending}")])
    for path in sorted(folder.glob("map.*")):
        content = path.read_bytes()
        if path.suffix == ".npz":  # zipped: the arrays are compared
            with np.load(path) as file:
                content = json.dumps({name: p.digest_of(file[name]) for name in sorted(file.files)}).encode()
        elif len(content) > KEPT_BYTES:
            content = digest(content).encode()
        found[f"maps/{path.name}.told"] = content
    for placed, title in ((False, "of_the_field"), (True, "of_its_capture")):
        for name, text in p.track_texts(placed).items():
            found[f"tracks/{title}.{name}"] = text.encode()
    return found


def packed_by(name: str, content: bytes) -> dict[str, str]:
    """The digest of what other libraries have packed, and their versions; empty where there are none."""
    if name == "mcap":
        versions = {library: version(library) for library in ("mcap", "zstandard", "rosbags")}
        return {"sha256": hashlib.sha256(content).hexdigest(), **versions}
    if name == "rosbag2":
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            packed = b"".join(archive.read(entry) for entry in sorted(archive.namelist()))
        versions = {"sqlite": sqlite3.sqlite_version, "rosbags": version("rosbags")}
        return {"sha256": hashlib.sha256(packed).hexdigest(), **versions}
    return {}


def digest(content: bytes) -> str:
    """SHA-256 and length of bytes."""
    return f"{hashlib.sha256(content).hexdigest()} {len(content)}"


def _records(content: bytes) -> dict[str, bytes]:
    from mcap.reader import make_reader

    reader = make_reader(io.BytesIO(content))
    header = reader.get_header()
    summary = reader.get_summary()
    assert summary is not None, "the file has a summary"
    parts = {"header": repr((header.profile, header.library)).encode()}
    for schema in summary.schemas.values():
        parts[f"schema {schema.id}"] = repr((schema.name, schema.encoding)).encode() + schema.data
    for channel in summary.channels.values():
        told = channel.topic, channel.message_encoding, channel.schema_id, sorted(channel.metadata.items())
        parts[f"channel {channel.id}"] = repr(told).encode()
    messages = [
        repr((channel.topic, message.log_time, message.publish_time, message.sequence)).encode() + message.data
        for _, channel, message in reader.iter_messages(log_time_order=False)
    ]
    parts["messages"] = b"".join(messages)
    parts["metadata"] = repr([(part.name, sorted(part.metadata.items())) for part in reader.iter_metadata()]).encode()
    assert summary.statistics is not None, "the file counts its messages"
    parts["statistics"] = repr(sorted(summary.statistics.channel_message_counts.items())).encode()
    return parts


def _bag(content: bytes) -> dict[str, bytes]:
    parts = {}
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        for entry in archive.infolist():
            told = archive.read(entry)
            assert zlib.crc32(told) == entry.CRC, "the zip is whole"
            parts[entry.filename] = _rows(told) if entry.filename.endswith(".db3") else told
    assert all(name.startswith(_BAG) for name in parts), "the bag is one folder"
    return parts


def _rows(database: bytes) -> bytes:
    """All of a database as SQL."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag.db3"
        path.write_bytes(database)
        connection = sqlite3.connect(path)
        try:
            return "\n".join(connection.iterdump()).encode()
        finally:
            connection.close()
