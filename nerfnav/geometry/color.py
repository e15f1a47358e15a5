"""Colour spaces: linear light, sRGB (IEC 61966-2-1), and filmic tone mapping (ACES) with its inverse.

Light adds up in linear space; pictures, pages and files hold sRGB. Viewers of high dynamic range map linear light to
what is displayed: Stephen Hill's fit of the Academy's reference rendering and output transform, as three.js applies
it to all materials.
"""

import numpy as np
from jaxtyping import Float


def to_srgb(linear: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Linear light in [0, 1] as sRGB in [0, 1]."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def to_linear(srgb: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """sRGB in [0, 1] as linear light in [0, 1]."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


_IN = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
_OUT = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])
_TOP = 0.0245786, 0.000090537
_BOTTOM = 0.983729, 0.4329510, 0.238081
_EXPOSURE = 1 / 0.6
_BRIGHTEST = 0.99
"""Of the curve, which never quite reaches 1 / 0.983729."""
_PURE = 0.4
"""By how much the purest colours must be darker than white: bright ones are all displayed pale."""

Light = Float[np.ndarray, "*shape 3"]


def tone_map(light: Light) -> Light:
    """Tone-map linear light from 0 on to displayed light, linear in [0, 1]."""
    value = _EXPOSURE * light @ _IN.T
    bottom = value * (_BOTTOM[0] * value + _BOTTOM[1]) + _BOTTOM[2]
    return np.clip((value * (value + _TOP[0]) - _TOP[1]) / bottom @ _OUT.T, 0, 1)


def invert_tone_map(displayed: Light) -> Light:
    """The linear light that is displayed so, from 0 on: very bright for what is nearly white.

    Bright and pure colours cannot be displayed at all: they come out as dark as they must, and keep their hue.
    """
    most = displayed.max(-1, keepdims=True)
    saturation = 1 - displayed.min(-1, keepdims=True) / np.maximum(most, 1e-9)
    displayed = displayed * np.minimum(1, (1 - _PURE * saturation**4) / np.maximum(most, 1e-9))
    value = np.clip(displayed @ np.linalg.inv(_OUT).T.astype(displayed.dtype), 0, _BRIGHTEST)
    # the positive root of the curve's quadratic equation
    square, line, rest = 1 - _BOTTOM[0] * value, _TOP[0] - _BOTTOM[1] * value, -(_TOP[1] + _BOTTOM[2] * value)
    root = (-line + np.sqrt(line**2 - 4 * square * rest)) / (2 * square)
    return np.maximum(root / _EXPOSURE @ np.linalg.inv(_IN).T.astype(displayed.dtype), 0)
