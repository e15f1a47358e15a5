"""Sums along a ray that make its colour and the derivative of that by the camera's pose, sample by sample.

Notation as in field/render.py, with o_i = rho_i step and p_i = origin + t_i direction. The light behind sample i is
T_i+1 = T_i exp(-o_i), and what it shines on is C - P_i, with P_i = sum_{j<=i} T_j alpha_j c_j. Then

    dC = sum_i [ (T_i+1 c_i + P_i - C) grad o_i' + T_i alpha_i grad c_i' ] dp_i
    dp_i = d(centre) + d(turn) x t_i direction

for a camera whose centre moves by d(centre) [m] and that turns by d(turn) [rad] about its centre, both in the world's
axes. One march is enough: C leaves the sum, sum_i (P_i - C) grad o_i = sum_i P_i grad o_i - C sum_i grad o_i.
"""

import math

import numpy as np

from nerfnav.compiled import kernel
from nerfnav.field.kernels.cells import sigmoid, softplus


@kernel(inline=True)
def values_and_slopes(values, cell, fraction, per_meter, mixed):
    """Fill `mixed` (channels, 4): value and gradient [1/m] of each channel between the 8 corners of a cell."""
    one = np.float32(1.0)
    i, j, k = cell
    x, y, z = fraction[0], fraction[1], fraction[2]
    for channel in range(4):
        near00, far00 = values[i, j, k, channel], values[i, j, k + 1, channel]
        near01, far01 = values[i, j + 1, k, channel], values[i, j + 1, k + 1, channel]
        near10, far10 = values[i + 1, j, k, channel], values[i + 1, j, k + 1, channel]
        near11, far11 = values[i + 1, j + 1, k, channel], values[i + 1, j + 1, k + 1, channel]
        edge00, edge01 = near00 + z * (far00 - near00), near01 + z * (far01 - near01)
        edge10, edge11 = near10 + z * (far10 - near10), near11 + z * (far11 - near11)
        face0, face1 = edge00 + y * (edge01 - edge00), edge10 + y * (edge11 - edge10)
        mixed[channel, 0] = face0 + x * (face1 - face0)
        mixed[channel, 1] = per_meter[0] * (face1 - face0)
        mixed[channel, 2] = per_meter[1] * ((one - x) * (edge01 - edge00) + x * (edge11 - edge10))
        along0 = (one - y) * (far00 - near00) + y * (far01 - near01)
        along1 = (one - y) * (far10 - near10) + y * (far11 - near11)
        mixed[channel, 3] = per_meter[2] * ((one - x) * along0 + x * along1)


@kernel(inline=True)
def add_sample(mixed, scale, step, distance, light, sums):
    """Add one sample to the sums of its ray; returns the light behind it.

    `sums` (4, 7): in the rows of the three channels P, the sum of all but C's share of dC / dp_i, and that sum weighted
    by t_i; in the last row, from its second number on, the sums of grad o_i and t_i grad o_i.
    """
    through = np.float32(math.exp(-scale * softplus(mixed[0, 0]) * step))
    weight, behind = light * (np.float32(1.0) - through), light * through
    slope = scale * step * sigmoid(mixed[0, 0])
    for channel in range(3):
        color = mixed[1 + channel, 0]
        sums[channel, 0] += weight * color
        pull = slope * (behind * color + sums[channel, 0])
        for axis in range(3):
            part = pull * mixed[0, 1 + axis] + weight * mixed[1 + channel, 1 + axis]
            sums[channel, 1 + axis] += part
            sums[channel, 4 + axis] += distance * part
    for axis in range(3):
        part = slope * mixed[0, 1 + axis]
        sums[3, 1 + axis] += part
        sums[3, 4 + axis] += distance * part
    return behind


@kernel(inline=True)
def finish_ray(sums, light, background, direction, color, jacobian):
    """Fill colour (3) and Jacobian (3, 6) of a ray from its sums and the light that is left."""
    x, y, z = direction[0], direction[1], direction[2]
    for channel in range(3):
        total = sums[channel, 0] + light * background[channel]
        color[channel] = total
        for axis in range(3):
            jacobian[channel, axis] = sums[channel, 1 + axis] - total * sums[3, 1 + axis]
        along_x = sums[channel, 4] - total * sums[3, 4]
        along_y = sums[channel, 5] - total * sums[3, 5]
        along_z = sums[channel, 6] - total * sums[3, 6]
        jacobian[channel, 3] = y * along_z - z * along_y
        jacobian[channel, 4] = z * along_x - x * along_z
        jacobian[channel, 5] = x * along_y - y * along_x
