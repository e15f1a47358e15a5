"""Judgement of a trained neural field."""

from dataclasses import replace

from nerfnav.field.calibration import calibrated
from nerfnav.field.neural import NeuralField
from nerfnav.geometry import PosedImages


def judged(trained: NeuralField, held_out: PosedImages) -> NeuralField:
    """The field on the CPU, with what views that it was not trained on say about it."""
    coarse, fine = trained.coarse.requires_grad_(False).cpu(), trained.fine.requires_grad_(False).cpu()
    trained = replace(trained, coarse=coarse, fine=fine)
    return replace(trained, info=calibrated(trained.info, trained, held_out))
