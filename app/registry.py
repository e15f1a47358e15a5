"""What users choose by name: `--estimator`; planners, robots and formats are in tables of the library."""

from collections.abc import Mapping
from typing import TypeVar

from nerfnav.errors import UnknownNameError
from nerfnav.estimator.fast import FastFilter, inerf
from nerfnav.estimator.filter import PoseFilter

ESTIMATORS = {"fast": FastFilter, "paper": PoseFilter, "inerf": inerf}
"""Name to what makes an estimator for a field, a robot and a camera."""

Entry = TypeVar("Entry")


def named(kind: str, name: str, known: Mapping[str, Entry]) -> Entry:
    """The entry called `name`; raises UnknownNameError that lists the known ones."""
    if name not in known:
        raise UnknownNameError(kind, name, known)
    return known[name]
