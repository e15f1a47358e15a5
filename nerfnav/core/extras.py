"""Optional dependencies: import where it is used what only some users need, and name the extra that installs it."""

import importlib
import importlib.util
from importlib import metadata
from typing import Any

from nerfnav.core.errors import MissingExtraError


def import_extra(module: str, extra: str, user: str) -> Any:
    """The module of that name, which `pip install 'nerfnav[EXTRA]'` installs; `user` names what needs it, in messages.

    Raises MissingExtraError, in one sentence, where it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError(user, module.partition(".")[0], extra) from error


def require_extra(module: str, extra: str, user: str) -> None:
    """Raise MissingExtraError, as `import_extra` does, where a module is not installed; it is not imported."""
    if importlib.util.find_spec(module) is None:
        raise MissingExtraError(user, module.partition(".")[0], extra)


def installed_version(distribution: str) -> str | None:
    """The version of a distribution that a person may have installed; None where it is not."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None
