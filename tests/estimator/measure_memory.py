"""How memory grows over many updates of the filter in a row: `python -m tests.estimator.measure_memory [UPDATES]`.

A process of its own, for the checks of shapes that tests switch on would take most of the time.
"""

import gc
import json
import sys
import tracemalloc
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import torch

from nerfnav.core.steps import run_steps
from nerfnav.estimator.core.filter_config import FilterConfig
from nerfnav.estimator.gauss_newton.fast_filter import FastFilter
from nerfnav.estimator.photometric.pyramid import PyramidConfig, SearchConfig
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.robots import StateNoise
from tests.estimator.places import CAMERA, COLOR_STD, HERE, HOVER, ROBOT, draws, near, picture, voxel_balls

CALM = StateNoise(0.002, 0.002, 0.002, 0.002)
QUICK = PyramidConfig(
    halvings=(0,), robust=(0.1,), iterations=(3,), pixels=64, search=SearchConfig(candidates=8, starts=2)
)
"""One short descent at full size, and a short search: the parts of an update are all there."""
DARK, NOISY = 5, 100
"""Of so many pictures one is black, and one is noise, which is searched for and then rejected."""


@dataclass(frozen=True)
class Memory:
    """What is in use after some updates."""

    updates: int
    """So many."""
    traced: int
    """Allocated by Python (tracemalloc) [bytes]."""
    resident: int
    """Of the whole process [bytes]."""


def memory_over(updates: int, every: int) -> Iterator[Memory]:
    """Follow a robot that hovers, some of whose pictures are useless, and tell what is in use now and then."""
    config = FilterConfig(process_noise=CALM, color_noise=ColorNoise(std=COLOR_STD), pyramid=QUICK)
    estimator = FastFilter(voxel_balls(), ROBOT, CAMERA, config=config)
    image, belief, generator = picture(voxel_balls(), HERE), near(HERE, 0), draws(1)
    noise = torch.randint(0, 256, image.shape, generator=generator, dtype=torch.uint8)
    tracemalloc.start()
    try:
        for index in range(1, updates + 1):
            seen = torch.zeros_like(image) if index % DARK == 0 else image
            seen = noise if index % NOISY == 0 else seen
            last = run_steps(estimator.update(belief, seen, HOVER, 0.1, generator))
            belief = last.posterior
            if index % every == 0:
                gc.collect()
                yield Memory(index, tracemalloc.get_traced_memory()[0], _resident())
    finally:
        tracemalloc.stop()


def _resident() -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


def main(updates: int = 10_000, marks: int = 5) -> None:
    """Print what is in use, `marks` times on the way, as lines of JSON."""
    torch.set_num_threads(1)
    for memory in memory_over(updates, updates // marks):
        sys.stdout.write(json.dumps(asdict(memory)) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
