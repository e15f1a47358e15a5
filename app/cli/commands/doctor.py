"""Whether kernels compile on this machine and agree with the torch path."""

import time
from typing import Any

import numba
import torch

from nerfnav.core.jit import threads
from nerfnav.core.kernel_cache import cache_folder
from nerfnav.field import VoxelField, render_rays
from nerfnav.geometry import Box


def check_kernels() -> dict[str, Any]:
    """Look through a small field with the compiled renderer and with the torch path that it stands for."""
    began = time.perf_counter()
    values = torch.linspace(-3, 0.5, 6**3 * 4).reshape(6, 6, 6, 4)
    field = VoxelField(Box.of((0, 0, 0), (1, 1, 1)), values, torch.ones(3))
    rays = torch.rand(64, 3, generator=torch.Generator().manual_seed(0)), torch.tensor([[0.0, 0.6, 0.8]]).expand(64, 3)
    with threads(2):  # as training does: planners and filters need no pool
        seen, expected = field.render_rays(*rays).color, render_rays(field, *rays).color
        layer = numba.threading_layer()  # type: ignore[attr-defined]
    return {
        "numba": numba.__version__,
        "agree": bool(torch.allclose(seen, expected, atol=2e-3)),
        "threading": layer,
        "ready_s": time.perf_counter() - began,
        "cache": str(cache_folder()),
    }
