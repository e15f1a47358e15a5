"""From posed images to a neural field, as the paper's NeRF was trained: Adam on the colour error of random rays.

Each ray is cut into bins with one random point each for the coarse network; its weights are then a distribution from
which the points of the fine network are drawn, together with the coarse ones. Both networks answer for the colour:

    L = mean |C_coarse - C|^2 + mean |C_fine - C|^2

(Mildenhall et al., "NeRF", ECCV 2020, Eqs. 5 and 6.) Sensible on a GPU, where it takes hours for a picture that the
voxel field of nerfnav/field/train.py has in a minute; on a CPU with small networks and small places.
"""

from collections.abc import Generator
from dataclasses import dataclass, replace

import torch

from nerfnav.compiled import default_threads, threads
from nerfnav.errors import InvalidInputError
from nerfnav.field.judgement import info_of, judged_networks
from nerfnav.field.neural import NeuralField
from nerfnav.field.neural_learner import NeuralLearner
from nerfnav.field.neural_train_config import NeuralTrainConfig
from nerfnav.field.progress import Progress
from nerfnav.field.rays import RaySampler
from nerfnav.geometry import PosedImages


@dataclass(frozen=True)
class NeuralTrainStep:
    """Where training stands."""

    iteration: int
    """Training steps done."""
    fraction: float
    """Share of the training that is done, 0 to 1."""
    psnr_db: float
    """Peak signal-to-noise ratio [dB]: of recent training rays; on the last step, of held-out views."""
    rays_per_s: float
    """Rays learned from in a second, since the start."""
    seconds_left: float
    """Estimated time to the end [s]."""
    field: NeuralField | None = None
    """The trained field, on the CPU; set on the last step."""

    @staticmethod
    def of(progress: Progress) -> "NeuralTrainStep":
        """A step before the last."""
        now = (progress.iteration, progress.fraction, progress.psnr_db)
        return NeuralTrainStep(*now, progress.rays_per_s, progress.seconds_left)


def train_neural(
    photographs: PosedImages,
    held_out: PosedImages,
    blank: NeuralField,
    config: NeuralTrainConfig,
    generator: torch.Generator,
) -> Generator[NeuralTrainStep, bool | None, None]:
    """Train the networks of `blank` (see `blank_field`), on the device where they are, and yield progress.

    The last step carries the field. Send True to stop early and keep what was learned. Raises InvalidInputError when
    there is no image.
    """
    if len(photographs) == 0:
        raise InvalidInputError("there is no image to train from; at least two are needed")
    learner = NeuralLearner(blank, config, generator)
    sampler = RaySampler(photographs, generator)
    progress = Progress(config.iterations, config.budget)
    stop: bool | None = None
    while progress.fraction < 1 and not stop:
        with threads(default_threads()):  # restores how many torch may use, which a parallel kernel forgets
            batch = sampler.draw(config.rays)
        progress.learned(learner.step(batch, config.rate * config.final_rate**progress.fraction), config.rays)
        if progress.is_due(config.report_every):
            stop = yield NeuralTrainStep.of(progress)
    info = replace(info_of(photographs, generator, progress.iteration), train_s=progress.elapsed_s)
    trained = judged_networks(replace(blank, info=info), held_out)
    rate, psnr = progress.iteration * config.rays / info.train_s, trained.info.psnr_db or progress.psnr_db
    yield NeuralTrainStep(progress.iteration, progress.fraction, psnr, rate, 0.0, trained)
