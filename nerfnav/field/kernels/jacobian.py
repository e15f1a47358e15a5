"""Colours of rays and their derivatives by the camera's pose: twin of differentiating `render_rays`.

The equations are those of kernels/ray_sums.py. Grids that are dense have a quicker kernel, kernels/sight.py.
"""

import numpy as np

from nerfnav.core.jit import kernel, prange
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW, node_counts, part_of
from nerfnav.field.kernels.light import STOPPED
from nerfnav.field.kernels.march import CHUNK, grid_ray, locate, next_sample, sample_count, scratch
from nerfnav.field.kernels.ray_sums import add_sample, finish_ray, values_and_slopes
from nerfnav.field.kernels.shell_slopes import add_shells


@kernel(parallel=True)
def colors_and_jacobian(values, occupied, lower, per_meter, origins, directions, scale, step, background, outer):
    """Colours (n, 3) of rays and their derivatives (n, 3, 6) by d(centre) [1/m] and d(turn) [1/rad].

    `outer` are the `Shells` around (see kernels/shells.py).
    """
    count = origins.shape[0]
    shape = node_counts(values, lower)
    colors = np.empty((count, 3), np.float32)
    jacobians = np.empty((count, 3, 6), np.float32)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        start, slope, cell, fraction, _ = scratch()
        mixed, sums = np.empty((4, 4), np.float32), np.empty((4, 7), np.float32)
        for ray in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            enter, leave = grid_ray(origins[ray], directions[ray], lower, per_meter, shape, start, slope)
            samples = sample_count(enter, leave, step)
            sums[:] = np.float32(0.0)
            light = np.float32(1.0)
            index = 0
            while index < samples and light > STOPPED:
                distance = locate(index, enter, step, start, slope, shape, cell, fraction)
                following = next_sample(index, enter, step, start, slope, cell, occupied)
                if following > index:
                    index = following
                    continue
                index += 1
                part, i, j, k = part_of(values, occupied, cell[0], cell[1], cell[2])
                values_and_slopes(part, (i, j, k), fraction, per_meter, mixed)
                if mixed[0, 0] >= NEGLIGIBLE_RAW:
                    light = add_sample(mixed, scale, step, distance, light, sums)
            if outer[0].shape[0] > 0 and light > STOPPED:
                through = (start, slope, directions[ray], shape, per_meter)
                light, _ = add_shells(outer, through, np.float32(0.0), light, np.float32(0.0), sums)
            finish_ray(sums, light, background, directions[ray], colors[ray], jacobians[ray])
    return colors, jacobians
