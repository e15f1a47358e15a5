"""How honest the fast filter's covariance is: `python -m tests.estimator.measure_honesty [FLIGHTS] [WORLD ...]`.

Flights as of `nerfnav experiment estimation`, all conditions with the same seeds, with the sizes of noises adapted and
not. NEES of the full state: 12 is honest. Medians and 90th percentiles are over flights.
"""

import statistics
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import pi, sin

import torch
from torch import Tensor

import nerfnav_scenes as scenes
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_config import FilterConfig
from nerfnav.estimator.gauss_newton.fast_filter import FastFilter
from nerfnav.experiments.arena import Arena, make_renderer, take_picture
from nerfnav.experiments.disturbed_flights import DT, Trial, fly_disturbed
from nerfnav.experiments.estimation import errors_of
from nerfnav.experiments.study import Row
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.checkpoint import load_field
from nerfnav.robots import CAMERA, StateNoise
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.state import RigidState
from nerfnav.world import MeshRenderer

WORLDS = ("stonehenge", "playground", "church")
FIRST = StateNoise.isotropic(0.01**2)
"""Spread of the first belief."""
Change = Callable[[Tensor, int, torch.Generator], Tensor]
"""What becomes of a picture (uint8), which is that of this step."""
Flight = tuple[int, Tensor, RigidState, list[Tensor], list[Tensor]]
"""Seed, actions, states, pictures, and the same with motion blur."""
HOVERING = torch.tensor([0.2] * 3 + [0.0] * 3 + [0.5] * 3 + [0.0] * 3)
"""Standard deviations of how a drone moves that hovers, along its tangent: 0.2 m/s and 0.5 rad/s."""
EXPOSURE_S = 0.02
"""How long a picture is exposed, which is blurred meanwhile [s]."""


def as_taken(image: Tensor, step: int, generator: torch.Generator) -> Tensor:
    return image


def exposed(image: Tensor, step: int, generator: torch.Generator) -> Tensor:
    """Gain drifts to and fro by 20 %."""
    return (image.float() * (1 + 0.2 * sin(2 * pi * (step + 5) / 20))).round().clamp(0, 255).to(torch.uint8)


def replaced(image: Tensor, step: int, generator: torch.Generator) -> Tensor:
    """5 % of the pixels are random."""
    where = torch.rand(*image.shape[:2], 1, generator=generator) < 0.05
    return torch.where(where, torch.randint(0, 256, image.shape, generator=generator, dtype=torch.uint8), image)


def covered(image: Tensor, step: int, generator: torch.Generator) -> Tensor:
    """10 % are covered by somebody in three colours who walks to and fro."""
    height, width = image.shape[0] // 2, image.shape[1] // 5
    left = int((image.shape[1] - width) * (0.5 + 0.45 * sin(0.6 * step)))
    colors = torch.tensor([[70, 50, 40], [40, 60, 120], [180, 140, 120]], dtype=torch.uint8)
    rows = colors[torch.arange(height) * 3 // height]
    changed = image.clone()
    changed[-height:, left : left + width] = rows[:, None]
    return changed


def blurred(renderer: MeshRenderer, state: RigidState, generator: torch.Generator) -> Tensor:
    """What a camera sees on average while a hovering drone moves around a state."""
    motion = HOVERING * torch.randn(len(HOVERING), generator=generator)
    times = EXPOSURE_S * torch.linspace(-0.5, 0.5, 7)
    seen = [take_picture(renderer, state.retract(time * motion).pose).float() for time in times]
    return torch.stack(seen).mean(0).round().to(torch.uint8)


CONDITIONS: dict[str, tuple[Change | None, float]] = {
    "clean": (as_taken, 1.0), "noise taken for half": (as_taken, 0.5), "noise taken for twice": (as_taken, 2.0),
    "exposure 20 %": (exposed, 1.0), "5 % of pixels": (replaced, 1.0), "10 % covered": (covered, 1.0),
    "motion blur": (None, 1.0),
}  # fmt: skip
"""What is changed in pictures (None: they are blurred), and by what factor the filter's process noise is wrong."""


def flights(arena: Arena, count: int) -> Iterator[Flight]:
    """Disturbed flights of the tasks in turn; tasks that none of many blind flights survives are left out."""
    tasks, renderer = [task for task in arena.scene.tasks if task.robot == "quadrotor"], make_renderer(arena)
    found = 0
    for seed in range(1000, 1000 + 3 * count):
        if found == count:
            return
        try:
            actions, states = fly_disturbed(arena, Trial(tasks[seed % 1000 % len(tasks)], seed))
        except InvalidInputError as error:
            sys.stderr.write(f"{error}\n")
            continue
        found += 1
        after, chance = [states[k] for k in range(1, len(actions) + 1)], torch.Generator().manual_seed(seed)
        sharp = [take_picture(renderer, state.pose) for state in after]
        yield seed, actions, states, sharp, [blurred(renderer, state, chance) for state in after]


def followed(filter_: FastFilter, flight: Flight, change: Change | None) -> list[Row]:
    """The errors of each step of a flight; no change: with motion blur."""
    seed, actions, states, sharp, blurry = flight
    images = blurry if change is None else sharp
    generator, chance = (torch.Generator().manual_seed(seed + more) for more in (0, 1))
    start = states[0].retract(FIRST.sample(torch.Generator().manual_seed(seed)))
    belief, rows = Belief(start, FIRST.covariance()), []
    for step, (action, image) in enumerate(zip(actions, images, strict=True)):
        seen = image if change is None else change(image, step, chance)
        last = run_steps(filter_.update(belief, seen, action, DT, generator))
        belief = last.posterior
        rows.append(errors_of(belief, states[step + 1]))
    return rows


def summary(rows: list[list[Row]]) -> str:
    """One line for all flights."""
    nees = sorted(statistics.fmean(row["nees"] for row in flight) for flight in rows)
    every = [row for flight in rows for row in flight]
    position, turn = (sorted(row[name] for row in every) for name in ("position_m", "rotation_rad"))
    inside = statistics.fmean(row["inside_95"] for row in every)
    return (
        f"NEES {statistics.median(nees):5.1f}, 90th {nees[int(0.9 * (len(nees) - 1))]:5.1f}  "
        f"position {1e3 * statistics.median(position):4.2f} mm, 95th {1e3 * position[int(0.95 * len(position))]:5.1f}  "
        f"attitude {statistics.median(turn) * 180 / pi:.3f} degrees  inside-95 {100 * inside:.0f} %"
    )


def main(count: int = 10, worlds: tuple[str, ...] = WORLDS) -> None:
    """Print the table."""
    torch.set_num_threads(1)
    for world in worlds:
        field = load_field(scenes.trained_path(world))
        assert isinstance(field, VoxelField), "the bundled worlds have dense fields"
        flown = [*flights(Arena(scenes.load(world), field), count)]
        for name, (change, size) in CONDITIONS.items():
            noise = StateNoise(0.02 * size, 0.01 * size, 0.02 * size, 0.01 * size)
            for adaptive in (False, True):
                config = replace(FilterConfig().for_field(field.info), process_noise=noise, adaptive=adaptive)
                filter_ = FastFilter(field, Quadrotor(), CAMERA, config=config)
                line = summary([followed(filter_, flight, change) for flight in flown])
                sys.stdout.write(f"{world:10} {name:21} {'adapted' if adaptive else 'as told':7}  {line}\n")
                sys.stdout.flush()


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 10, tuple(sys.argv[2:]) or WORLDS)
