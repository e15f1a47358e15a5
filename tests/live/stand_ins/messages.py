"""Message classes of ROS 2 by their definitions: only what a message has can be set, and what is sent must encode."""

from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)


def class_of(kind: str) -> Any:
    """The class of a type such as geometry_msgs/msg/Pose: all fields are there, with default values."""
    fields = dict(STORE.fielddefs[kind][1])

    def begin(self: Any, **given: Any) -> None:
        for name, definition in fields.items():
            object.__setattr__(self, name, given.pop(name) if name in given else _default(definition))
        assert not given, f"{kind} has no {given}"

    def change(self: Any, name: str, value: Any) -> None:
        assert name in fields, f"{kind} has no {name}"
        object.__setattr__(self, name, value)

    return type(kind.rsplit("/", 1)[1], (), {"__init__": begin, "__setattr__": change, "kind": kind})


def _default(definition: Any) -> Any:
    kind, argument = definition
    if kind == Nodetype.NAME:
        return class_of(argument)()
    if kind == Nodetype.BASE:
        return "" if argument[0] == "string" else 0.0 if argument[0].startswith("float") else 0
    return [_default(argument[0]) for _ in range(argument[1])] if kind == Nodetype.ARRAY else []


def check(message: Any) -> None:
    """Encode it, as sending does."""
    STORE.serialize_cdr(_arrays(message), message.kind)


def _arrays(message: Any) -> Any:
    """The same with arrays where rosbags wants them."""
    import numpy as np

    for name, (kind, argument) in STORE.fielddefs[message.kind][1]:
        value = getattr(message, name)
        if kind == Nodetype.NAME:
            _arrays(value)
        elif kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            if argument[0][0] == Nodetype.NAME:
                for entry in value:
                    _arrays(entry)
            elif argument[0][1][0] != "string":
                setattr(message, name, np.asarray(value, argument[0][1][0]))
    return message
