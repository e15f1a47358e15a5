"""The command `nerfnav`: imports the subcommand of COMMANDS that is run, a file in app/cli/commands, and no other.

So help comes at once, although the commands that compute need seconds to import their libraries.
"""

import contextlib
import importlib
import io
import math
import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from keyword import iskeyword
from pathlib import Path
from types import ModuleType
from typing import Any

import tyro

from nerfnav import __version__
from nerfnav.core.errors import InvalidInputError, InvalidNumberError, NerfnavError, UnknownNameError
from nerfnav.core.renamed import replace_old_options
from nerfnav_app.cli.help import ALL, HELP, format_help
from nerfnav_app.system import importing, use_one_blas_thread

COMMANDS = {
    "serve": "open a scene or a field in the browser (what `nerfnav` alone does, with stonehenge)",
    "open": "open anything in the browser: a field, a mesh, a capture, splats, a video, a trained NeRF",
    "scenes": "list the bundled scenes and their tasks",
    "train": "train a field of a scene, a mesh or photographs",
    "import": "make a field of a trained NeRF or of Gaussian splats",
    "bake": "turn a field into a voxel field",
    "place": "georeference a field: set its scale and floor, and crop it",
    "info": "print what a field file holds",
    "calibrate": "measure how far the pictures of a field can be trusted",
    "plan": "plan a trajectory through a field",
    "fly": "fly a trajectory with nothing but a simulated camera, replanning at every step",
    "localize": "find where in a field a picture was taken",
    "track": "track a camera through a field: a video, a folder of pictures, a recording",
    "live": "guide a real vehicle: pictures in at a local socket, its pose and next setpoints out",
    "export": "write the trajectory of a plan or a flight in another format",
    "map": "write what planners take for free, solid or unproven, for other programs",
    "experiment": "run one of the experiments: trials judged on the ground truth, a table, figures",
    "report": "write one page of what experiments have measured: tables, figures, flights",
    "bench": "time nerfnav against the paper's way on this machine",
    "doctor": "check this machine: threads, GPU, kernels, browser, LieTorch",
}
"""Name and purpose of every subcommand, in the order of a first visit."""
FAILED, BAD_INPUT, INTERRUPTED, PIPE_CLOSED = 1, 2, 130, 141
"""Exit codes."""
_STYLE = (tyro.conf.FlagCreatePairsOff, tyro.conf.PositionalMetavarFromFieldName)


def main(words: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code: 0, or 2 with one sentence on stderr for bad input."""
    words = list(sys.argv[1:] if words is None else words)
    use_one_blas_thread()
    try:
        if words[:1] in (["-h"], ["--help"], [ALL], ["help"]):
            print(usage())
        elif words[:1] == ["--version"]:
            print(f"nerfnav {__version__}")
        elif not set(words).isdisjoint(HELP):
            print(explain(words))
        else:
            command, arguments = parse(words)
            with warnings.catch_warnings():
                # of numpy, in readers of foreign files: what is wrong with a file is in the one sentence
                warnings.simplefilter("ignore", RuntimeWarning)
                warnings.showwarning = _as_sentences(warnings.showwarning)
                command.run(arguments)
        sys.stdout.flush()
    except NerfnavError as error:
        message = name_option(error, words) if isinstance(error, InvalidNumberError) else error
        print(f"nerfnav: {message}", file=sys.stderr)
        return BAD_INPUT
    except BrokenPipeError:  # the reader, such as `head`, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains when it ends
        return PIPE_CLOSED
    except OSError as error:
        print(f"nerfnav: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("nerfnav: stopped", file=sys.stderr)
        return INTERRUPTED
    return 0


def _as_sentences(show: Callable[..., None]) -> Callable[..., None]:
    """Show warnings of nerfnav's own classes as a sentence without a place in the source, others by `show`."""

    def show_warning(message: Warning | str, category: type[Warning], *where: Any, **options: Any) -> None:
        if category.__module__.startswith("nerfnav."):
            print(f"nerfnav: {message}", file=sys.stderr)
        else:
            show(message, category, *where, **options)

    return show_warning


def usage() -> str:
    """Write the text of `nerfnav --help`."""
    lines = ["usage: nerfnav [COMMAND] [OPTIONS]", "", "Robots that navigate inside radiance fields.", "", "commands:"]
    lines += [f"  {name:<10} {purpose}" for name, purpose in COMMANDS.items()]
    return "\n".join([*lines, "", "`nerfnav COMMAND --help` lists the options; all commands take --json."])


def explain(words: Sequence[str]) -> str:
    """Write the help of the subcommand of a command line: every option with --help-all. Raises NerfnavError."""
    name, command, rest = _command_of(words)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        parser: Any = tyro.extras.get_parser(_shape_of(command, rest), prog=f"nerfnav {name}", config=_STYLE)
    return format_help(parser, name, complete=ALL in rest)


def parse(words: Sequence[str]) -> tuple[ModuleType, Any]:
    """The module of the subcommand that a command line asks for, and its arguments.

    Without a subcommand it is `serve`. Old options give a warning on stderr. Raises NerfnavError where the words make
    no sense.
    """
    name, command, rest = _command_of(words)
    rest, replaced = replace_old_options(rest)
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            arguments = tyro.cli(_shape_of(command, rest), args=rest, prog=f"nerfnav {name}", config=_STYLE)
    except SystemExit as stop:
        raise InvalidInputError(f"{_first_paragraph(complaint.getvalue())}; see `nerfnav {name} --help`") from stop
    for old, new in replaced.items():  # only now: a word that is no option was not renamed either
        print(f"nerfnav: {old} is now {new}: the next release removes the old name", file=sys.stderr)
    require_finite(arguments)
    require_sources_fetched(arguments)
    return command, arguments


def require_finite(arguments: Any, prefix: str = "--", nested: str = "") -> None:
    """Raise InvalidInputError for NaN and infinity. `nested` stands between the names of a record and its entries.

    Records of a subcommand itself leave no trace in names: theirs are as short as its own.
    """
    for entry in fields(arguments):
        value, name = getattr(arguments, entry.name), prefix + entry.name.replace("_", "-")
        if is_dataclass(value):
            require_finite(value, f"{name}{nested}" if nested else prefix, ".")
        elif isinstance(value, float) and not math.isfinite(value):
            raise InvalidInputError(f"{name} must be a finite number, not {value}")


def require_sources_fetched(arguments: Any) -> None:
    """Raise InvalidInputError where an argument, of any kind, names a pointer of Git LFS in place of a file."""
    from nerfnav.core.files import require_fetched  # imports numpy, after use_one_blas_thread

    for entry in fields(arguments):
        value = getattr(arguments, entry.name)
        if is_dataclass(value):
            require_sources_fetched(value)
        elif entry.name != "out":  # what is written takes the pointer's place
            for name in value if isinstance(value, list | tuple) else (value,):
                if isinstance(name, str | Path) and os.path.isfile(name):
                    require_fetched(Path(name))


def name_option(error: InvalidNumberError, words: Sequence[str]) -> InvalidNumberError:
    """Name the option as it was typed in place of its field; the field stays where none, or several have its name."""
    options = {word.partition("=")[0] for word in words if word.startswith("--")}
    field = error.name.replace("_", "-")
    named = [option for option in options if option.removeprefix("--").rpartition(".")[2] == field]
    return InvalidNumberError(named[0], error.wanted, error.number) if len(named) == 1 else error


def _command_of(words: Sequence[str]) -> tuple[str, ModuleType, list[str]]:
    """Name and module of the subcommand, and the words after it."""
    name, rest = ("serve", words) if not words or words[0].startswith("-") else (words[0], words[1:])
    if name not in COMMANDS:
        raise UnknownNameError("command", name, COMMANDS)
    with importing():
        module = f"nerfnav_app.cli.commands.{name}{'_' if iskeyword(name) else ''}"
        return name, importlib.import_module(module), list(rest)


def _shape_of(command: ModuleType, words: Sequence[str]) -> type[Any]:
    """The record of a subcommand's arguments, which may depend on the words."""
    return command.arguments_for(words) if hasattr(command, "arguments_for") else command.Arguments


def _first_paragraph(box: str) -> str:
    """First paragraph of a parser's complaint, without the frame around it and the suggestions after it."""
    lines = [line.strip("│| ") for line in box.splitlines() if not line.startswith(("╭", "╰", "+"))]
    paragraphs = "\n".join("" if set(line) <= set("─-") else line for line in lines).split("\n\n")
    titled = not box.startswith("╭")  # frames of plain letters have their title inside
    return re.sub(r"(?<=one of )\((.*)\)", _list_choices, " ".join(paragraphs[titled].split()).removesuffix("."))


def _list_choices(found: re.Match[str]) -> str:
    """List the choices of an option in a lasting order, without the None of one that need not be given."""
    return ", ".join(sorted(set(re.findall(r"'(.*?)'", found[1])) - {"None"}))
