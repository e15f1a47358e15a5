"""Photometric consistency: how well a picture agrees with the field at an estimated pose."""

from collections import deque
from dataclasses import dataclass

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
    """Agreement of a picture's compared colours with the field's."""

    difference: float
    """Robust root mean square of their differences, in [0, 1]."""
    unexplained: float
    """Share of the picture's own variance that the field does not show, likewise robust: 0 where all is there, about 1
    where another place would be as good."""

    @classmethod
    def of(cls, step: FilterStep, picture: UInt8[Tensor, "height width 3"]) -> "PhotometricConsistency | None":
        """Compute it at the end of an update; None where nothing was compared."""
        if not len(step.residual):
            return None
        colors = picture[step.pixels[:, 1], step.pixels[:, 0]].float() / 255
        variance, left = _square(difference(colors - colors.mean(0))), _square(step.residual)
        return cls(left**0.5, left / max(variance, _LEVELS**2))


@dataclass
class UsualDifference:
    """Usual difference of pictures and field at the right pose: at most that of held-out photographs."""

    most: float
    """Difference of held-out photographs: a standard deviation."""
    remembered: int
    """Pictures of which the median is taken."""

    def __post_init__(self) -> None:
        self._last: deque[float] = deque(maxlen=self.remembered)

    @property
    def difference(self) -> float:
        """Median of the last pictures."""
        return min(self.most, max(_LEVELS, float(np.median(self._last)))) if self._last else self.most

    def add(self, difference: float) -> None:
        """Add a picture at a pose that is right."""
        self._last.append(difference)

    def restart(self, difference: float) -> None:
        """Take this difference as right from here on: the field looks otherwise, blurred from near, say."""
        self.most = max(self.most, difference)
        self._last.clear()
        self.add(difference)


def _square(size: Tensor) -> float:
    return float(size.clamp_max(_SATURATION).square().mean())
