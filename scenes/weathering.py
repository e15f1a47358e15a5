"""Weathering of stones: the effect of wind, moss and lichen on their colour."""

import numpy as np
import trimesh

from nerfnav_scenes.light import from_srgb
from nerfnav_scenes.noise import fractal, mix, noise, smoothstep

_HUES = [
    (0.64, 0.61, 0.56),
    (0.58, 0.57, 0.55),
    (0.67, 0.60, 0.51),
    (0.57, 0.58, 0.54),
    (0.64, 0.57, 0.53),
    (0.55, 0.57, 0.59),
    (0.69, 0.64, 0.54),
]
"""sRGB: from warm sandstone to cool slate."""
_OCHRE, _LICHEN, _MOSS, _CRACK = (0.76, 0.55, 0.24), (0.80, 0.81, 0.72), (0.36, 0.41, 0.22), (0.28, 0.26, 0.24)


def weathered(mesh: trimesh.Trimesh, seed: int) -> np.ndarray:
    """Linear colours (v, 3) of a stone in the world: its own hue, mottled from 20 cm down to 2.5 cm."""
    points = mesh.vertices
    own = points + 3.1 * seed
    base = from_srgb(_HUES[seed % len(_HUES)])
    broad = np.stack([noise(own, 0.20, 900 + k) for k in range(3)], -1)
    shade = 0.26 * noise(own, 0.18, 910) + 0.36 * noise(own, 0.07, 911) + 0.40 * noise(own, 0.026, 912)
    color = base * (1 + 0.10 * broad) * np.exp(shade)[:, None]
    # rain streaks: a pattern drawn out along the stone's height
    streak = smoothstep(0.35, 0.9, noise(own * [1, 1, 0.12], 0.035, 920))
    color = mix(color, from_srgb(_CRACK), 0.55 * streak)
    color = mix(color, from_srgb(_LICHEN), 0.75 * smoothstep(0.35, 0.75, fractal(own, 0.07, 930)))
    color = mix(color, from_srgb(_OCHRE), 0.75 * smoothstep(0.42, 0.78, fractal(own, 0.09, 940 + seed % 3)))
    damp = smoothstep(0.09, 0.0, points[:, 2] + 0.04 * noise(own, 0.05, 950))
    return mix(color, from_srgb(_MOSS), 0.6 * damp)
