"""Registry of estimators: the one table that every choice of an estimator reads."""

from collections.abc import Callable
from dataclasses import dataclass

from nerfnav.core.registry import Registry
from nerfnav.estimator.core.protocol import Estimator
from nerfnav.estimator.gauss_newton.fast_filter import FastFilter, inerf
from nerfnav.estimator.paper.pose_filter import PoseFilter


@dataclass(frozen=True)
class EstimatorEntry:
    """An estimator, as users choose it by name."""

    name: str
    """What they call it, as in `--estimator`."""
    make: Callable[..., Estimator]
    """Makes it: (field, robot, camera, mount=T_body_camera, config=FilterConfig)."""


ESTIMATORS: Registry[EstimatorEntry] = Registry(
    "estimator",
    (EstimatorEntry("fast", FastFilter), EstimatorEntry("paper", PoseFilter), EstimatorEntry("inerf", inerf)),
)
"""Name to estimator."""


def names() -> tuple[str, ...]:
    """What `load` knows."""
    return tuple(ESTIMATORS)


def load(name: str) -> EstimatorEntry:
    """The estimator of that name; raises UnknownNameError that lists the known ones."""
    return ESTIMATORS[name]


def register(entry: EstimatorEntry) -> None:
    """Make an estimator known by its name. Raises NameTakenError where another one has it."""
    ESTIMATORS.register(entry)
