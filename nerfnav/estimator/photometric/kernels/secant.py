"""Sums over the colours of a picture by secants: twin of the equations of secant.py in the folder above."""

import numpy as np

from nerfnav.core.jit import kernel


@kernel()
def sum_secants(shown, colors, exposure, bounds, information, push):
    """Fill the information J'WJ (8, 8) of independent colours, and their push J'Wr (8), by the six standard deviations,
    gain and bias; returns the mean of w r^2.

    `shown` (12, m, 3) are the colours that the field shows ahead along the six axes, then behind, and `colors` (m, 3)
    the picture's. `bounds` are how far ahead they are taken [standard deviations], the variance of a colour's noise,
    and Huber's bound.
    """
    (away, noise, robust), (gain, bias) = bounds, exposure
    row, misfit = np.empty(8), 0.0
    information[:] = 0.0
    push[:] = 0.0
    for pixel in range(shown.shape[1]):
        for channel in range(3):
            mean, square = 0.0, 0.0
            for n in range(12):
                mean += shown[n, pixel, channel] / 12.0
            for n in range(12):
                square += (shown[n, pixel, channel] - mean) ** 2 / 12.0
            for axis in range(6):
                slope = (shown[axis, pixel, channel] - shown[6 + axis, pixel, channel]) / (2.0 * away)
                square -= slope * slope
                row[axis] = (1.0 + gain) * slope
            row[6], row[7] = mean, 1.0
            residual = (1.0 + gain) * mean + bias - colors[pixel, channel]
            weight = min(robust / max(abs(residual), 1e-9), 1.0) / (noise + max(square, 0.0))
            misfit += weight * residual * residual
            for i in range(8):
                push[i] += weight * residual * row[i]
                for j in range(i + 1):
                    information[i, j] += weight * row[i] * row[j]
    for i in range(8):
        for j in range(i):
            information[j, i] = information[i, j]
    return misfit / (3.0 * shown.shape[1])
