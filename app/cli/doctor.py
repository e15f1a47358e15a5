"""nerfnav doctor: what this machine has."""

import os
import platform
import shutil
from dataclasses import dataclass
from typing import Any

import torch

from nerfnav.compiled import default_threads
from nerfnav.estimator.retraction import retraction_backend
from nerfnav_app.cli.kernel_check import check_kernels
from nerfnav_app.cli.terminal import show

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "firefox")


@dataclass(frozen=True)
class Arguments:
    """Tell what this machine has: threads, GPU, kernels, browser, LieTorch."""

    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Print what was found; nothing that is missing keeps nerfnav from working."""
    show("this machine", examine(), arguments.json)


def examine() -> dict[str, Any]:
    """What was found, by name."""
    browsers = {name: path for name in _BROWSERS if (path := shutil.which(name))}
    return {
        "python": platform.python_version(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "threads": default_threads(),
        "torch": torch.__version__,
        "gpu": torch.cuda.get_device_name(0) if torch.cuda.is_available() else None,
        "kernels": check_kernels(),
        "browser": next(iter(browsers.values()), None),
        "retraction": retraction_backend(),
    }
