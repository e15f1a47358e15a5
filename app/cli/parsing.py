"""Words of a command line to the arguments of a subcommand."""

import contextlib
import importlib
import io
import math
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from keyword import iskeyword
from typing import Any

import tyro

from app.cli.catalog import COMMANDS
from app.system.fast_imports import importing
from nerfnav.errors import InvalidInputError, UnknownNameError

_STYLE = (tyro.conf.FlagCreatePairsOff, tyro.conf.PositionalMetavarFromFieldName)


def parse(words: Sequence[str]) -> tuple[Any, Any]:
    """The module of the subcommand that a command line asks for, and its arguments.

    Without a subcommand it is `serve`. Raises NerfnavError where the words make no sense.
    """
    name, rest = ("serve", words) if not words or words[0].startswith("-") else (words[0], words[1:])
    if name not in COMMANDS:
        raise UnknownNameError("command", name, COMMANDS)
    with importing():
        command = importlib.import_module(f"app.cli.{name}{'_' if iskeyword(name) else ''}")
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            shape = command.arguments_for(rest) if hasattr(command, "arguments_for") else command.Arguments
            arguments = tyro.cli(shape, args=rest, prog=f"nerfnav {name}", config=_STYLE)
    except SystemExit as stop:
        if not stop.code:
            raise  # help was asked for and given
        raise InvalidInputError(f"{_sentence(complaint.getvalue())}; see `nerfnav {name} --help`") from stop
    _require_finite(arguments)
    return command, arguments


def _require_finite(arguments: Any, prefix: str = "--") -> None:
    """Refuse NaN and infinity wherever a number can be given."""
    for entry in fields(arguments):
        value, name = getattr(arguments, entry.name), prefix + entry.name.replace("_", "-")
        if is_dataclass(value):
            _require_finite(value, f"{name}.")
        elif isinstance(value, float) and not math.isfinite(value):
            raise InvalidInputError(f"{name} must be a finite number, not {value}")


def _sentence(box: str) -> str:
    """What a parser's complaint says first, without the frame around it and what it suggests after it."""
    lines = [line.strip("│| ") for line in box.splitlines() if not line.startswith(("╭", "╰", "+"))]
    paragraphs = "\n".join("" if set(line) <= set("─-") else line for line in lines).split("\n\n")
    titled = not box.startswith("╭")  # frames of plain letters have their title inside
    return " ".join(paragraphs[titled].split()).removesuffix(".")
