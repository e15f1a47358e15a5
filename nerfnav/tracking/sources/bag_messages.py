"""What is in a recording of ROS 2: its topics, and the messages of each."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from itertools import takewhile
from pathlib import Path, PurePosixPath
from typing import Any

from nerfnav.errors import InvalidInputError
from nerfnav.extras import from_extra

_USER = "reading a recording of ROS"
Message = Any
"""A message of ROS, whose type is made of its definition when it is read."""


def messages(path: Path, topic: str) -> Iterator[tuple[float, Message]]:
    """Time [s] and content of each message of a topic."""
    for written_ns, message in read(path, topic):
        stamp = message.header.stamp
        taken_ns = 10**9 * stamp.sec + stamp.nanosec
        yield 1e-9 * (taken_ns or written_ns), message


def read(path: Path, topic: str) -> Iterator[tuple[int, Message]]:
    """When each message of a topic was written [ns], and what it is; none, where there is no such topic."""
    with opened(path) as reader:
        wanted = [connection for connection in reader.connections if connection.topic == topic]
        for connection, written_ns, data in reader.messages(wanted) if wanted else ():
            yield written_ns, _typestore().deserialize_cdr(data, connection.msgtype)


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """A reader of the recording, which turns what it complains about into one sentence."""
    rosbag2 = from_extra("rosbags.rosbag2", "ros", _USER)
    try:
        with rosbag2.Reader(path) as reader:
            yield reader
    except Exception as error:  # its storages raise of four libraries' own kinds where a file is damaged
        why = " ".join(str(error).split()) or type(error).__name__
        raise InvalidInputError(f"{path} is no whole recording of ROS 2, or cut off: {why}") from error


@cache
def _typestore() -> Any:
    """Message types of ROS 2."""
    typesys = from_extra("rosbags.typesys", "ros", _USER)
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)


def chosen(path: Path, pictured: list[str], topic: str | None) -> str:
    """The topic to read: the given one, or the only one. Raises InvalidInputError where there is none such."""
    if not pictured:
        raise InvalidInputError(f"{path} has no pictures: nothing in it is a sensor_msgs/Image or CompressedImage")
    listed = ", ".join(sorted(pictured))
    if topic is not None and topic not in pictured:
        raise InvalidInputError(f"{path} has no pictures in {topic}; it has some in {listed}")
    if topic is None and len(pictured) > 1:
        raise InvalidInputError(f"{path} has pictures in several topics: choose one with --topic of {listed}")
    return topic or pictured[0]


def _shared(name: str, topic: str) -> int:
    """How many parts of a topic's namespace are those of another topic, from the root."""
    pairs = zip(PurePosixPath(name).parent.parts, PurePosixPath(topic).parts, strict=False)
    return len(list(takewhile(lambda pair: pair[0] == pair[1], pairs)))


def is_above(name: str, topic: str) -> bool:
    """Whether a topic is in the namespace of another one, or in one around that."""
    return _shared(name, topic) == len(PurePosixPath(name).parent.parts)


def nearest(names: list[str], topic: str) -> str | None:
    """The topic whose namespace has most in common with another one, then the first by name."""
    return min(names, key=lambda name: (-_shared(name, topic), name), default=None)
