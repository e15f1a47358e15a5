"""Evaluation of a trained field: occupancy of its nodes, and PSNR and measurement noise by held-out photographs.

The residual of a colour is far from Gaussian: most of a picture is matched closely, and edges that lie half a voxel
off are far out. So there are three numbers. `noise_std` is the root mean square over all pixels and channels, tails
and all: this is what the filters take for their measurement noise, since it promises no more than the field keeps.
`noise_core_std` is 1.4826 times the median absolute residual of the pixels that show more than the background, which
outliers do not move: what the noise would be if they were all found. `outlier_share` is the share of those pixels
that err by more than three times as much in some channel: what a filter that rejects outliers must expect.

Photographs of real places differ in exposure. Filters take one gain of each picture out; so it is taken out of
held-out pictures before their noise is measured (see nerfnav/field/train/exposure.py). PSNR is given both of the raw
pictures, as the literature has it, and of these.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core.deadline import Deadline
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.occupancy import classify_nodes
from nerfnav.field.core.protocol import Field
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.carving import CarvingConfig, carve_free_space
from nerfnav.field.proof.fusion import FusedDepth
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.field.train.exposure import estimate_common_gains, leave_out
from nerfnav.geometry import PosedImages, psnr_db

_DEVIATION_PER_MEDIAN = 1.4826
"""Standard deviation of a Gaussian whose median absolute value is 1."""
_OUTLIER_DEVIATIONS = 3.0
_TRIED, _COARSER = 4, 4
"""Pictures, and reduction of a picture, by which the time of the evaluation is predicted."""
_REST = 1.1
"""Time of the evaluation, in that of one round of the proof and of the held-out views: later rounds have little left to
prove (measured: 0.97 to 1.17)."""
_SOMETHING = 0.5
"""Opacity above which a pixel shows the field and not the background, which has no residual."""


def calibrate_noise(info: FieldInfo, field: Field, held_out: PosedImages, exposure: bool = False) -> FieldInfo:
    """`info` with what held-out photographs say about the field; unchanged where there are none.

    With `exposure`, these may be brighter or darker than the field.
    """
    if len(held_out) == 0:
        return info
    seen = [render_image(field, held_out.camera, held_out.poses[index]) for index in range(len(held_out))]
    colors, opacity = torch.stack([view.color for view in seen]), torch.stack([view.opacity for view in seen])
    mask = held_out.mask
    colors, taken = (leave_out(part, mask) for part in (colors, held_out.images.float() / 255))
    raw = _psnr_db(colors - taken, mask)
    gain = estimate_common_gains(taken, colors) if exposure else torch.ones(len(held_out))
    error = gain[:, None, None, None] * colors - taken
    counted = error if mask is None else error[mask]
    shown = opacity > _SOMETHING if mask is None else (opacity > _SOMETHING) & mask
    residual = error[shown] if shown.any() else counted.reshape(-1, 3)
    core = _DEVIATION_PER_MEDIAN * residual.abs().median()
    return replace(
        info,
        psnr_db=raw,
        psnr_one_exposure_db=_psnr_db(error, mask) if exposure else None,
        noise_std=float(counted.square().mean().sqrt()),
        noise_core_std=float(core),
        outlier_share=float((residual.abs() > _OUTLIER_DEVIATIONS * core).any(-1).float().mean()),
    )


def _psnr_db(error: Float[Tensor, "n height width 3"], mask: Bool[Tensor, "n height width"] | None) -> float:
    """PSNR as the literature has it: the mean over the images [dB], of the pixels in `mask`."""
    images = error if mask is None else [image[part] for image, part in zip(error, mask, strict=True) if part.any()]
    each = [psnr_db(image.square().mean().item()) for image in images]
    return sum(each) / len(each)


def describe_training(photographs: PosedImages, generator: torch.Generator, iterations: int) -> FieldInfo:
    """Field info before evaluation: the date, the number of images, the seed."""
    return FieldInfo(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        made_by="trained",
        images=len(photographs),
        seed=generator.initial_seed(),
        iterations=iterations,
    )


def evaluate_grid(
    field: VoxelField,
    depth: FusedDepth | None,
    photographs: PosedImages,
    held_out: PosedImages,
    exposure: bool,
    carving: Deadline | None = None,
) -> VoxelField:
    """Evaluate a trained grid: classify its nodes, and measure its quality on held-out views.

    `photographs` are of one exposure; where `exposure` is set, held-out ones need not be. `carving` limits the time to
    prove space free by pictures.
    """
    free = carve_free_space(field, photographs, until=carving) if depth is None else depth.free
    trained = replace(field, evidence=classify_nodes(free, field.values[..., 0]))
    source, proof = ("pictures", "pictures") if depth is None else ("pictures and depth", "depth")
    info = replace(field.info, learned_from=source, proven_from=proof)
    return replace(trained, info=calibrate_noise(info, trained, held_out, exposure))


@dataclass(frozen=True)
class EvaluationCost:
    """Predicted time of the evaluation of a field."""

    proof_s: float = 0.0
    """Time of one round over all pictures, which proves space free [s]."""
    noise_s: float = 0.0
    """Time to render held-out views [s]."""

    @property
    def total_s(self) -> float:
        """Time of both, of further rounds, and of what is small beside them [s]."""
        return _REST * (self.proof_s + self.noise_s)


def predict_cost(
    field: VoxelField, depth: FusedDepth | None, photographs: PosedImages, held_out: PosedImages
) -> EvaluationCost:
    """Predict the time of `evaluate_grid`, by doing it for a few pictures."""
    proof_s, once, count = 0.0, CarvingConfig(rounds=1), len(photographs)
    if depth is None:
        one, few = (photographs.subset(slice(0, count, -(-count // number))) for number in (1, _TRIED))
        carve_free_space(field, one, once)  # compiles
        alone, more = (_seconds_of(lambda some=some: carve_free_space(field, some, once)) for some in (one, few))
        each = max(0.0, more - alone) / max(1, len(few) - 1)
        proof_s = alone + (count - 1) * each
    return EvaluationCost(proof_s, predict_noise_s(field, held_out))


def predict_noise_s(field: Field, held_out: PosedImages) -> float:
    """Predict the time of `calibrate_noise` [s], by rendering some rays of a held-out photograph."""
    if len(held_out) == 0:
        return 0.0
    camera, pose = held_out.camera, held_out.poses[0]
    small = camera.resized(max(1, camera.width // _COARSER), max(1, camera.height // _COARSER))
    render_image(field, small, pose)  # compiles
    each = _seconds_of(lambda: render_image(field, small, pose)) / (small.width * small.height)
    return each * camera.width * camera.height * len(held_out)


def _seconds_of(work: Callable[[], object]) -> float:
    clock = Deadline()
    work()
    return clock.elapsed_s
