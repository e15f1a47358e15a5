"""The command `nerfnav`. Each subcommand is a file in app/cli/commands, imported only when it is asked for.

So help comes at once, although the commands that compute need seconds to import their libraries.
"""

import contextlib
import importlib
import io
import sys
from collections.abc import Sequence
from keyword import iskeyword
from typing import Any

import tyro

from nerfnav import __version__
from nerfnav.core.errors import InvalidInputError, NerfnavError, UnknownNameError
from nerfnav_app.cli.number_arguments import require_finite
from nerfnav_app.system import importing

COMMANDS = {
    "serve": "open a scene or a field in the browser (what `nerfnav` alone does, with stonehenge)",
    "open": "open anything in the browser: a field, a mesh, a capture, splats, a video, a trained NeRF",
    "scenes": "list the bundled scenes and their tasks",
    "train": "train a field of a scene, a mesh, or somebody's photographs",
    "import": "make a field of a trained NeRF or of Gaussian splats",
    "bake": "turn a field into a voxel field",
    "place": "say how long a metre is and where the floor is in a field, and crop it",
    "info": "tell what a field file holds",
    "plan": "plan a trajectory through a field",
    "fly": "fly a trajectory with nothing but a simulated camera, replanning at every step",
    "localize": "find where in a field a picture was taken",
    "track": "follow a camera through a field: a video, a folder of pictures, a recording",
    "live": "guide a real vehicle: pictures in at a local socket, its pose and next setpoints out",
    "export": "write the trajectory of a plan or a flight in another format",
    "map": "write what planners take for free, solid or unproven, for other programs",
    "experiment": "run one of the experiments: trials judged on the ground truth, a table, figures",
    "bench": "time nerfnav against the paper's way on this machine",
    "doctor": "tell what this machine has: threads, GPU, kernels, browser, LieTorch",
}
"""Name and purpose of every subcommand, in the order of a first visit."""
FAILED, BAD_INPUT, INTERRUPTED = 1, 2, 130
"""Exit codes."""
_STYLE = (tyro.conf.FlagCreatePairsOff, tyro.conf.PositionalMetavarFromFieldName)


def main(words: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code: 0, or 2 with one sentence on stderr for bad input."""
    words = list(sys.argv[1:] if words is None else words)
    try:
        if words[:1] in (["-h"], ["--help"], ["help"]):
            print(usage())
        elif words[:1] == ["--version"]:
            print(f"nerfnav {__version__}")
        else:
            command, arguments = parse(words)
            command.run(arguments)
    except NerfnavError as error:
        print(f"nerfnav: {error}", file=sys.stderr)
        return BAD_INPUT
    except OSError as error:
        print(f"nerfnav: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("nerfnav: stopped", file=sys.stderr)
        return INTERRUPTED
    return 0


def usage() -> str:
    """What `nerfnav --help` prints."""
    lines = ["usage: nerfnav [COMMAND] [OPTIONS]", "", "Robots that navigate inside radiance fields.", "", "commands:"]
    lines += [f"  {name:<10} {purpose}" for name, purpose in COMMANDS.items()]
    return "\n".join([*lines, "", "`nerfnav COMMAND --help` tells the options; all commands take --json."])


def parse(words: Sequence[str]) -> tuple[Any, Any]:
    """The module of the subcommand that a command line asks for, and its arguments.

    Without a subcommand it is `serve`. Raises NerfnavError where the words make no sense.
    """
    name, rest = ("serve", words) if not words or words[0].startswith("-") else (words[0], words[1:])
    if name not in COMMANDS:
        raise UnknownNameError("command", name, COMMANDS)
    with importing():
        command = importlib.import_module(f"nerfnav_app.cli.commands.{name}{'_' if iskeyword(name) else ''}")
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            shape = command.arguments_for(rest) if hasattr(command, "arguments_for") else command.Arguments
            arguments = tyro.cli(shape, args=rest, prog=f"nerfnav {name}", config=_STYLE)
    except SystemExit as stop:
        if not stop.code:
            raise  # help was asked for and given
        raise InvalidInputError(f"{_sentence(complaint.getvalue())}; see `nerfnav {name} --help`") from stop
    require_finite(arguments)
    return command, arguments


def _sentence(box: str) -> str:
    """What a parser's complaint says first, without the frame around it and what it suggests after it."""
    lines = [line.strip("│| ") for line in box.splitlines() if not line.startswith(("╭", "╰", "+"))]
    paragraphs = "\n".join("" if set(line) <= set("─-") else line for line in lines).split("\n\n")
    titled = not box.startswith("╭")  # frames of plain letters have their title inside
    return " ".join(paragraphs[titled].split()).removesuffix(".")
