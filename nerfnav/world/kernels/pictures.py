"""Shading of pictures: blend the colours at the hits of rays, and average them to the bytes of pixels.

Nothing is reordered or fused here: a byte that rounds the other way would be another flight of the same seed.
"""

import numpy as np

from nerfnav.core.jit import kernel


@kernel(exact=True)
def blend(corners, faces, weights, values):
    """Fill values (n, c): those at the corners (f, 3, c) of the faces (n,), by their weights (n, 3)."""
    for ray in range(faces.shape[0]):
        at = corners[faces[ray]]
        for channel in range(values.shape[1]):
            first = weights[ray, 0] * np.float32(at[0, channel])
            second = weights[ray, 1] * np.float32(at[1, channel])
            values[ray, channel] = first + second + weights[ray, 2] * np.float32(at[2, channel])


@kernel(exact=True)
def average(colors, seen, sky, image):
    """Fill an image (h, w, 3) with the mean of each pixel's rays: colors (h, k, w, k, 3), or the sky."""
    side = colors.shape[1]
    count, half = np.float32(side * side), np.float32(0.5)
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            for channel in range(3):
                total = np.float32(0.0)
                for i in range(side):
                    for j in range(side):
                        ray = colors[row, i, column, j, channel] if seen[row, i, column, j] else sky[channel]
                        total += ray
                image[row, column, channel] = np.uint8(total / count + half)
