"""Commands for developers that do something for bundled fields, those that are named or all."""

import sys
from collections.abc import Callable

import nerfnav_scenes as scenes
from nerfnav.core.errors import NerfnavError


def for_named(does: Callable[[list[str]], None]) -> None:
    """Do it for the names on the command line, or for all scenes that have a field; what is wrong is one sentence."""
    try:
        does(sys.argv[1:] or scenes.with_fields())
    except NerfnavError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(2)
