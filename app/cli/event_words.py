"""What a progress bar says of an event besides its fraction."""

from functools import singledispatch

from nerfnav.field import TrainStep
from nerfnav.navigation import NavigationStep
from nerfnav.planner import PlanStep


@singledispatch
def tell(event: object) -> str:
    """What a progress bar says of an event besides its fraction; empty for most events."""
    return ""


@tell.register
def _(event: PlanStep) -> str:
    return f"iteration {event.iteration + 1}, J = {event.cost.total:.4g}"


@tell.register
def _(event: TrainStep) -> str:
    speed = f"{event.rays_per_s / 1e3:.0f} k rays/s"
    return f"PSNR {event.psnr_db:.1f} dB, {speed}, {event.seconds_left:.0f} s left"


@tell.register
def _(event: NavigationStep) -> str:
    error = (event.truth.position - event.belief.mean.position).norm().item()
    return f"step {event.index}, {event.time:.1f} s, believed position off by {100 * error:.1f} cm"
