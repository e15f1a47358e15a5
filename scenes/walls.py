"""Walls with openings: upright panels around doors, arches and windows, and the glass in them.

A wall runs along its own x axis, with y across and z up; every curve is a function of x.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from nerfnav_scenes.parts import Finish, Part
from nerfnav_scenes.primitives import Curve, fused, panel

Span = tuple[float, float]

_OVERLAP = 0.001
"""Panes reach so far into their walls [m]."""


@dataclass(frozen=True)
class Opening:
    """A hole in a wall, as wide as its span."""

    low: Curve
    """Its lower edge [m]."""
    high: Curve
    """Its upper edge [m]."""


def level(height: float) -> Curve:
    """Curve of a straight edge."""
    return lambda x: np.full_like(x, height)


def arch(span: Span, spring: float, point: float = 0.62) -> Curve:
    """The edge above an opening: two arcs whose radii are `point` times its width, pointed for more than 0.5."""
    width, middle = span[1] - span[0], 0.5 * (span[0] + span[1])
    radius = point * width

    def height(x: np.ndarray) -> np.ndarray:
        away = np.minimum(np.abs(x - middle), width / 2) + radius - width / 2
        return spring + np.sqrt(np.maximum(radius**2 - away**2, 0))

    return height


def rose(middle: float, height: float, radius: float) -> Opening:
    """Opening of a rose window."""

    def reach(x: np.ndarray) -> np.ndarray:
        return np.sqrt(np.maximum(radius**2 - (x - middle) ** 2, 0))

    return Opening(lambda x: height - reach(x), lambda x: height + reach(x))


def lancet(middle: float, width: float, sill: float, spring: float) -> tuple[Span, list[Opening]]:
    """A narrow pointed window, as an entry of a wall's openings."""
    span = (middle - width / 2, middle + width / 2)
    return span, [Opening(level(sill), arch(span, spring, 0.75))]


@dataclass(frozen=True)
class Wall:
    """A wall from x = ends[0] to ends[1]."""

    ends: Span
    """[m]"""
    depth: float
    """Its thickness [m]."""
    base: float
    """Height of its foot [m]."""
    top: Curve
    """Its upper edge [m]."""
    openings: Mapping[Span, Sequence[Opening]]
    """From below to above; spans must not overlap. One whose lower edge is below the base is a doorway."""

    def stones(self, finish: Finish, edge: float) -> Part:
        """Wall without its openings, in one piece."""
        pieces, left = [], self.ends[0]
        for span, openings in sorted(self.openings.items()):
            if span[0] > left:
                pieces.append(self._piece((left, span[0]), level(self.base), self.top, edge))
            lower = level(self.base)
            for opening in openings:
                if np.max(opening.low(np.array(span))) > self.base:
                    pieces.append(self._piece(span, lower, opening.low, edge))
                lower = opening.high
            pieces.append(self._piece(span, lower, self.top, edge))
            left = span[1]
        if left < self.ends[1]:
            pieces.append(self._piece((left, self.ends[1]), level(self.base), self.top, edge))
        return Part.of(fused(pieces), finish)

    def panes(self, finish: Finish, thickness: float, edge: float) -> list[Part]:
        """Glass in all openings but doorways."""
        parts = []
        for (left, right), openings in self.openings.items():
            for opening in openings:
                if np.max(opening.low(np.array((left, right)))) > self.base:
                    high = _at_least(opening.high, opening.low)
                    span = (left - _OVERLAP, right + _OVERLAP)
                    parts.append(Part.of(panel(span, thickness, opening.low, high, edge), finish, glass=True))
        return parts

    def _piece(self, span: Span, low: Curve, high: Curve, edge: float) -> trimesh.Trimesh:
        return panel(span, self.depth, low, high, edge)


def _at_least(high: Curve, low: Curve) -> Curve:
    return lambda x: np.maximum(high(x), low(x) + _OVERLAP)
