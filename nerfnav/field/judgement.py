"""Judgement of a trained field: what is proven of its nodes, and what held-out views say about it."""

from dataclasses import replace
from datetime import UTC, datetime

import torch

from nerfnav.field.calibration import calibrated
from nerfnav.field.carving import carved
from nerfnav.field.evidence import states_of
from nerfnav.field.fusion import Fused
from nerfnav.field.info import FieldInfo
from nerfnav.field.neural import NeuralField
from nerfnav.field.voxel import VoxelField
from nerfnav.geometry import PosedImages


def info_of(photographs: PosedImages, generator: torch.Generator, iterations: int) -> FieldInfo:
    """What is known of a field before it is judged: when it was made, of how many images, with which seed."""
    return FieldInfo(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        images=len(photographs),
        seed=generator.initial_seed(),
        iterations=iterations,
    )


def judged(
    field: VoxelField,
    told: Fused | None,
    photographs: PosedImages,
    held_out: PosedImages,
    exposure: bool,
) -> VoxelField:
    """What was learned, with what is proven of its nodes and with what held-out views say about it.

    `photographs` are of one exposure; where `exposure` is set, held-out ones need not be.
    """
    free = carved(field, photographs) if told is None else told.free
    trained = replace(field, evidence=states_of(free, field.values[..., 0]))
    taught, proven = ("pictures", "pictures") if told is None else ("pictures and depth", "depth")
    info = replace(field.info, learned_from=taught, proven_from=proven)
    return replace(trained, info=calibrated(info, trained, held_out, exposure))


def judged_networks(trained: NeuralField, held_out: PosedImages) -> NeuralField:
    """The field on the CPU, with what views that it was not trained on say about it."""
    coarse, fine = trained.coarse.requires_grad_(False).cpu(), trained.fine.requires_grad_(False).cpu()
    trained = replace(trained, coarse=coarse, fine=fine)
    return replace(trained, info=calibrated(trained.info, trained, held_out))
