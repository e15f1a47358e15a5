"""The command `nerfnav`. Each subcommand is a file in this folder, imported only when it is asked for.

So help comes at once, although the commands that compute need seconds to import their libraries.
"""

import sys
from collections.abc import Sequence

from app.cli.catalog import COMMANDS
from app.cli.parsing import parse
from nerfnav import __version__
from nerfnav.errors import NerfnavError

FAILED, BAD_INPUT, INTERRUPTED = 1, 2, 130
"""Exit codes."""


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
