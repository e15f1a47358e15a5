"""nerfnav doctor: report the threads, GPU, browser and kernels of this machine.

The check of the kernels compiles the renderer and compares it with the torch path.
"""

import platform
import shutil
import time
from dataclasses import dataclass
from typing import Any

import numba
import torch

from nerfnav.core.jit import count_cores, default_threads, threads
from nerfnav.core.kernel_cache import cache_folder
from nerfnav.estimator.paper.retraction import retraction_backend
from nerfnav.field import VoxelField, render_rays
from nerfnav.geometry import Box
from nerfnav_app.cli.terminal import Output, show


def check_kernels() -> dict[str, Any]:
    """Render a small field with the compiled renderer and with its torch path, and compare."""
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


_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "firefox")


@dataclass(frozen=True)
class Arguments(Output):
    """Check this machine: threads, GPU, kernels, browser, LieTorch."""


def run(arguments: Arguments) -> None:
    """Print what was found; nothing that is missing keeps nerfnav from working."""
    show("this machine", examine(), arguments.json)


def examine() -> dict[str, Any]:
    """Collect the findings by name."""
    return {
        "python": platform.python_version(),
        "cores": count_cores(),
        "threads": default_threads(),
        "torch": torch.__version__,
        "gpu": torch.cuda.get_device_name(0) if torch.cuda.is_available() else None,
        "kernels": check_kernels(),
        "browser": next(filter(None, map(shutil.which, _BROWSERS)), None),
        "retraction": retraction_backend(),
    }
