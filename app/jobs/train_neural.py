"""Train the paper's own kind of field, two networks, from what any source yields."""

from collections.abc import Generator

import torch

from nerfnav.errors import InvalidInputError
from nerfnav.field import MlpConfig, NeuralField, NeuralTrainConfig, train_neural
from nerfnav.field.neural_blank import blank_field
from nerfnav_app.jobs.events import JobEvent, Progress
from nerfnav_app.jobs.training_data.gather import TrainingData
from nerfnav_app.jobs.training_data.quality import QUALITIES
from nerfnav_app.jobs.training_data.request import NeuralOptions, TrainRequest

_LAYERS_BEFORE_SKIP = 5


def learn_networks(
    material: TrainingData, request: TrainRequest, options: NeuralOptions, generator: torch.Generator
) -> Generator[JobEvent, bool | None, NeuralField]:
    """Yield progress and return the field; send True to end early and keep what was learned.

    Raises InvalidInputError without the device that was asked for, or where photographs show more than the box.
    """
    if options.device.startswith("cuda") and not torch.cuda.is_available():
        raise InvalidInputError("there is no CUDA device here: train with --device cpu, and small networks")
    if not material.bounded:
        raise InvalidInputError(
            "these photographs show more than a box, and a neural field has nothing around its box: "
            "train a voxel field, which has"
        )
    skips = (_LAYERS_BEFORE_SKIP,) if options.layers > _LAYERS_BEFORE_SKIP + 1 else ()
    network = MlpConfig(options.layers, options.layer_width, skips, view_widths=(max(1, options.layer_width // 2),))
    asked = round(QUALITIES[request.quality].steps * NeuralTrainConfig.iterations)
    config = NeuralTrainConfig(
        network, request.iterations or asked, request.budget, rays=options.rays
    )
    blank = blank_field(material.box, material.background, network, generator, options.device)
    steps = train_neural(material.learned, material.held_out, blank, config, generator)
    step = next(steps)
    while step.field is None:
        stop = yield Progress(f"training, PSNR {step.psnr_db:.1f} dB", step.fraction)
        step = steps.send(stop)
    return step.field
