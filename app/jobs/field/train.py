"""What a training is configured to, by the request and by what is trained from."""

from dataclasses import replace

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import TrainConfig
from nerfnav.geometry import Box
from nerfnav_app.jobs.field.request import QUALITIES, Quality, pixel_size, voxel_of
from nerfnav_app.jobs.training_data.gather import TrainingData, TrainRequest

MOST_VOXELS = 30_000_000
"""Training holds a dozen numbers for each voxel and thread."""
OUTSIDE_NODES = 128
"""Nodes along each edge of the grid over what photographs show around the box."""
SMOOTHNESS = (1e-8, 1e-7)
"""Weights of the roughness of densities and of colours for real photographs, which are few and differ in exposure."""

CUT_OUT_RAYS = (1 / 8, 1 / 4, 1 / 2)
"""Shares of rays in the steps of each stage where pictures are cut out: their outlines tell the shape, and it takes
many steps, not many rays, to fill it in."""
CUT_OUT_PATCH = 2
"""Pixels along each edge of patches of rays there: twice as many rays are learned from in the same time."""
CUT_OUT_TIME = (0.08, 0.2, 0.72)
"""Share of each stage in the budget there: coarse grids have nothing more to learn soon."""


def config_for(request: TrainRequest, material: TrainingData) -> TrainConfig:
    config = request.config if material.bounded else _of_photographs(request.config)
    if material.learned.silhouettes is not None:
        config = replace(config, stage_rays=CUT_OUT_RAYS, stage_time=CUT_OUT_TIME, patch=CUT_OUT_PATCH)
    quality = QUALITIES[request.quality]
    return replace(
        config,
        voxel=request.voxel or _voxel(quality, material, config),
        iterations=request.iterations or round(quality.steps * (material.iterations or config.iterations)),
        budget=request.budget,
    )


def _voxel(quality: Quality, material: TrainingData, config: TrainConfig) -> float:
    """The voxel of a quality; what photographs of a real place tell apart, no quality makes finer."""
    suited = material.voxel or config.voxel
    pixel = pixel_size(material.learned, material.box) if material.bounded else suited
    finest = 1.001 * (material.box.size.prod().item() / MOST_VOXELS) ** (1 / 3)
    return voxel_of(quality, suited, max(pixel, finest))


def _of_photographs(config: TrainConfig) -> TrainConfig:
    """The same for photographs of a real place: what is around the box is learned too, and all of it more smoothly."""
    rough_density, rough_color = SMOOTHNESS
    return replace(
        config,
        outside=config.outside or OUTSIDE_NODES,
        exposure=True,
        rough_density=config.rough_density or rough_density,
        rough_color=config.rough_color or rough_color,
    )


def require_room(box: Box, voxel: float) -> None:
    if box.size.prod().item() / voxel**3 > MOST_VOXELS:
        raise InvalidInputError(
            f"a field of {box.describe()} with voxels of {voxel:g} m would have more than {MOST_VOXELS} of them: "
            "choose a larger --voxel"
        )
