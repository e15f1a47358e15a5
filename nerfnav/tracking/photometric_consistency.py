"""Photometric consistency: how well a picture agrees with the field at an estimated pose."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.estimator import FilterStep
from nerfnav.estimator.photometric.residuals import difference

_SATURATION = 0.3
"""Colour differences above this count as this where pictures are judged [1 = full scale]."""
_LEVELS = 2 / 255
"""Pictures that differ by no more than this are alike, however well those before them fitted [1 = full scale]."""


@dataclass(frozen=True)
class PhotometricConsistency:
    """How a picture's colours, where they were compared, agree with the field's."""

    difference: float
    """Robust root mean square of their differences, in [0, 1]."""
    unexplained: float
    """Share of the picture's own variance that the field does not show, likewise robust: 0 where all is there, about 1
    where another place would be as good."""

    @classmethod
    def of(cls, step: FilterStep, picture: UInt8[Tensor, "height width 3"]) -> "PhotometricConsistency | None":
        """At the end of an update; None where nothing was compared."""
        if not len(step.residual):
            return None
        colors = picture[step.pixels[:, 1], step.pixels[:, 0]].float() / 255
        told, left = _square(difference(colors - colors.mean(0))), _square(step.residual)
        return cls(left**0.5, left / max(told, _LEVELS**2))


@dataclass
class UsualDifference:
    """How far pictures differ from a field where the pose is right: no more than held-out photographs did."""

    told: float
    """What those did: a standard deviation."""
    remembered: int
    """Pictures that tell it."""
    _last: deque[float] = field(init=False)

    def __post_init__(self) -> None:
        self._last = deque(maxlen=self.remembered)

    @property
    def difference(self) -> float:
        """Of the last pictures, in the middle."""
        return min(self.told, max(_LEVELS, float(np.median(self._last)))) if self._last else self.told

    def add(self, difference: float) -> None:
        """One more, at a pose that is right."""
        self._last.append(difference)

    def begin_anew(self, difference: float) -> None:
        """From here on the field looks otherwise, near to what it shows blurred, say: this much is right."""
        self.told = max(self.told, difference)
        self._last.clear()
        self.add(difference)


def _square(size: Tensor) -> float:
    return float(size.clamp_max(_SATURATION).square().mean())
