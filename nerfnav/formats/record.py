"""Typed records: convert JSON and YAML into structs, and report which keys were used, ignored or unknown.

Every error is one sentence with the name of the file, the path of the key, the value there, and what is needed in its
place. Bounds of numbers and lengths of texts stand in the types of a struct's fields, as `msgspec.Meta`.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args

import msgspec
import yaml
from msgspec import Meta

from nerfnav.core.errors import InvalidInputError

R = TypeVar("R", bound=msgspec.Struct)

LARGEST = 1e12
"""Bound of the numbers of files: none that means something reaches it."""
Number = Annotated[float, Meta(gt=-LARGEST, lt=LARGEST)]
"""Finite number."""
Positive = Annotated[float, Meta(gt=0, lt=LARGEST)]
"""Finite number above 0."""
Pixels = Annotated[float, Meta(ge=1, le=65536, multiple_of=1)]
"""Width or height of a picture [pixels]; programs also write 1080.0."""
FileName = Annotated[str, Meta(min_length=1, max_length=4096, pattern="^[^\\x00\\ud800-\\udfff]*$")]
"""Name of a file: no NUL, and no half of a surrogate pair, which no file system takes."""
_LONGEST_INTEGER = 300
"""Digits from which an integer exceeds double precision: it is read as infinite, and refused as such."""
_SHOWN = 40
"""Characters of a value that an error shows."""
_TYPES = {
    "float": "a number", "int": "a whole number", "str": "a text", "bool": "true or false", "array": "a list",
    "object": "a set of keys with values", "null": "null",
}  # fmt: skip
"""Names of types in the messages of msgspec, and for people."""


@dataclass(frozen=True)
class KeyReport:
    """Keys of a file by their treatment; those of list items have a path such as frames[].file_path."""

    used: tuple[str, ...] = ()
    """Keys that were read."""
    ignored: Mapping[str, str] = field(default_factory=dict, hash=False)
    """Keys of the format that are not read, with the reason."""
    unknown: tuple[str, ...] = ()
    """Keys that the format does not have."""

    def merge(self, other: "KeyReport") -> "KeyReport":
        """Join the reports of two files of one capture; each key stands once."""
        return KeyReport(
            tuple(dict.fromkeys((*self.used, *other.used))),
            {**self.ignored, **other.ignored},
            tuple(dict.fromkeys((*self.unknown, *other.unknown))),
        )

    def ignoring(self, reason: str, *keys: str) -> "KeyReport":
        """Move those of the `keys` that were used to the ignored ones."""
        moved = {key: reason for key in keys if key in self.used}
        used = tuple(key for key in self.used if key not in moved)
        return KeyReport(used, {**self.ignored, **moved}, self.unknown)


def read_text(path: Path) -> str:
    """Read text as UTF-8, or as UTF-16 or UTF-32 by its byte order mark. Raises InvalidInputError where it is none."""
    try:
        data = path.read_bytes()
    except FileNotFoundError as error:
        raise InvalidInputError(f"there is no file {path}") from error
    except (OSError, ValueError) as error:
        raise InvalidInputError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from error
    try:
        return data.decode(json.detect_encoding(data))
    except UnicodeDecodeError as error:
        raise InvalidInputError(f"{path} is not readable as text: byte {error.start} is no {error.encoding}") from error


def parse_json(text: str, what: object) -> Any:
    """Parse JSON, NaN and infinities too; `what` is the name of the file. Raises InvalidInputError for other text."""
    try:
        return json.loads(text, parse_int=_parse_integer)
    except (ValueError, RecursionError) as error:
        raise InvalidInputError(
            f"{what} is not readable as JSON: it is empty, cut off or another kind of file"
        ) from error


def parse_yaml(text: str, what: object, loader: type[yaml.SafeLoader] = yaml.SafeLoader) -> list[Any]:
    """Parse the documents of YAML; `what` is the name of the file. Raises InvalidInputError for other text."""
    try:
        return list(yaml.load_all(text, loader))
    except (yaml.YAMLError, ValueError, TypeError, RecursionError, AttributeError) as error:
        reason = " ".join(str(error).split())[:160]
        raise InvalidInputError(f"{what} is not readable as YAML: {reason}") from error


def read_record(path: Path, kind: type[R]) -> tuple[R, KeyReport]:
    """Read a file of JSON into a struct of type `kind`. Raises InvalidInputError where it does not fit."""
    content = parse_json(read_text(path), path)
    return convert_record(content, kind, path), report_keys(content, kind)


def convert_record(content: Any, kind: type[R], what: object, strict: bool = True) -> R:
    """Convert parsed content to a struct of type `kind`; `what` is the name of the file.

    Without `strict`, texts count as numbers where a number is needed: YAML 1.1 reads 1e-3 as a text. Raises
    InvalidInputError, with the key's path, for a value that does not fit.
    """
    try:
        return msgspec.convert(content, kind, strict=strict)
    except msgspec.ValidationError as error:
        raise InvalidInputError(f"{what}: {_sentence(str(error), content)}") from error
    except UnicodeEncodeError as error:
        raise InvalidInputError(f"{what} has the key {printable(error.object)}, which is no text") from error
    except (RecursionError, OverflowError) as error:
        raise InvalidInputError(f"{what} is nested without end, or has a number beyond double precision") from error


def report_keys(content: Any, kind: type[msgspec.Struct]) -> KeyReport:
    """Sort the keys of content that `kind` describes; its `IGNORED` maps keys of the format to the reason."""
    rows = dict(_sorted_keys(content, kind, ""))
    return KeyReport(
        tuple(key for key, (known, _) in rows.items() if known),
        {key: reason for key, (known, reason) in rows.items() if not known and reason},
        tuple(key for key, (known, reason) in rows.items() if not known and not reason),
    )


def _sorted_keys(content: Any, kind: type[msgspec.Struct], prefix: str) -> Iterator[tuple[str, tuple[bool, str]]]:
    """Yield the path of each key, whether a field reads it, and the reason why none does."""
    fields = {entry.encode_name: entry for entry in msgspec.structs.fields(kind)}
    ignored: Mapping[str, str] = getattr(kind, "IGNORED", {})
    for key, value in content.items():
        shown = prefix + printable(key)
        yield shown, (key in fields, ignored.get(key, ""))
        inner = _inner_struct(fields[key].type) if key in fields else None
        if inner is None:
            continue
        items = value if isinstance(value, list | tuple) else [value]
        nested = f"{shown}[]." if isinstance(value, list | tuple) else f"{shown}."
        for item in items:
            if isinstance(item, dict):
                yield from _sorted_keys(item, inner, nested)


def _inner_struct(annotation: Any) -> type[msgspec.Struct] | None:
    """The struct in a type such as list[Frame] | None; None in one without."""
    if isinstance(annotation, type) and issubclass(annotation, msgspec.Struct):
        return annotation
    return next((inner for part in get_args(annotation) if (inner := _inner_struct(part)) is not None), None)


def _parse_integer(digits: str) -> int | float:
    return int(digits) if len(digits) < _LONGEST_INTEGER else math.copysign(math.inf, -1 if digits[0] == "-" else 1)


def _sentence(message: str, content: Any) -> str:
    """Say what is wrong, from the message of msgspec for `content`."""
    reason, _, place = message.partition(" - at ")
    place = place.strip("`").removeprefix("$")
    path = place.removeprefix(".") or "the file"
    if missing := re.fullmatch("Object missing required field `(.*)`", reason):
        return f"{path} has no {missing[1]}"
    if unknown := re.fullmatch("Object contains unknown field `(.*)`", reason):
        return f"{path} has the key {printable(unknown[1])}, which the format does not have"
    if place.startswith("key"):
        owner = place.partition(" in ")[2].strip("`").removeprefix("$").removeprefix(".")
        return f"a key of {owner or 'the file'} is no text"
    return f"{path} is {_value_at(content, place)}, {_needed(reason)} is needed"


def _needed(reason: str) -> str:
    """Say in words which value a field takes, by a message such as "Expected `float | null`, got `str`"."""
    expected = re.match("Expected `([^`]*)`( [^,]*)?", reason)
    if expected is None:
        return "another value" if reason != "Number out of range" else "a finite number"
    kind = " or ".join(_TYPES.get(name, name) for name in expected[1].split(" | ") if name != "null")
    bound = (expected[2] or "").strip()
    if "regex" in bound or (kind == "a text" and "length" in bound):
        return "a text that can name a file"
    if str(LARGEST) in bound:
        return "a finite number"
    return f"{kind} {_in_words(bound)}".strip()


def _in_words(bound: str) -> str:
    """A bound such as "of length >= 1" or "< 5.0" as words."""
    bound = bound.replace("that's a multiple of 1.0", "without a fraction").replace("of length", "with a length of")
    for sign, words in {">=": "at least", "<=": "at most", ">": "above", "<": "below"}.items():
        bound = bound.replace(f"{sign} ", f"{words} ")
    return re.sub(r"[-+.\d]+(e[-+]?\d+)?$", lambda number: f"{float(number[0]):g}", bound)


def _value_at(content: Any, place: str) -> str:
    """The value at a path such as .frames[3].fl_x, as text."""
    try:
        for key, index in re.findall(r"\.([^.\[]+)|\[(\d+|\.\.\.)\]", place):
            content = content[key] if key else content[int(index)]
    except (KeyError, IndexError, TypeError, ValueError):
        return "of another kind"
    if isinstance(content, list | dict):
        return f"a list of {len(content)}" if isinstance(content, list) else "a set of keys"
    if isinstance(content, float) and math.isinf(content):
        return "infinite, or too large a number"
    try:
        return printable(json.dumps(content, ensure_ascii=False, default=str))
    except (TypeError, ValueError):
        return "too large"


def printable(value: object) -> str:
    """A value of a file as text that can be printed, shortened."""
    text = str(value).encode("utf-8", "backslashreplace").decode()
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
