"""Registry of estimators: the one table that every choice of an estimator reads."""

from collections.abc import Callable
from dataclasses import dataclass

from nerfnav.core.registry import Registry
from nerfnav.estimator.core.filter_step import Estimator
from nerfnav.estimator.gauss_newton.fast_filter import FastFilter, inerf
from nerfnav.estimator.paper.pose_filter import PoseFilter


@dataclass(frozen=True)
class EstimatorEntry:
    """Estimator that users choose by name."""

    name: str
    """Name, as in `--estimator`."""
    make: Callable[..., Estimator]
    """Constructor: (field, robot, camera, mount=T_body_camera, config=FilterConfig)."""


ESTIMATORS: Registry[EstimatorEntry] = Registry(
    "estimator",
    (EstimatorEntry("fast", FastFilter), EstimatorEntry("paper", PoseFilter), EstimatorEntry("inerf", inerf)),
)
"""Name to estimator."""


def names() -> tuple[str, ...]:
    """Return the registered names."""
    return tuple(ESTIMATORS)


def load(name: str) -> EstimatorEntry:
    """Return the estimator of a name; raises UnknownNameError that lists the known ones."""
    return ESTIMATORS[name]


def register(entry: EstimatorEntry) -> None:
    """Register an estimator under its name. Raises NameTakenError for a name that is taken."""
    ESTIMATORS.register(entry)
