"""Colours are learned on a geometry that stays as it is."""

import torch

from nerfnav.core.steps import run_steps
from nerfnav.field.core.occupancy import EMPTY_RAW, Occupancy
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.train.colors import train_colors
from nerfnav.field.train.evaluation import calibrate_noise
from nerfnav.geometry import node_positions
from tests.field.fields import BOX, ball, photographs_of_ball


def test_colours_become_those_of_the_pictures_and_densities_stay() -> None:
    views, shape = photographs_of_ball(12, 32), (41, 41, 23)
    inside = node_positions(BOX, shape).norm(dim=-1) < 0.32
    values = torch.full((*shape, 4), 0.5)
    values[..., 0] = torch.where(inside, 1.0, EMPTY_RAW)
    states = torch.where(inside, int(Occupancy.SOLID), int(Occupancy.FREE)).to(torch.uint8)
    grey = VoxelField(BOX, values, ball().background, evidence=states)
    before = calibrate_noise(grey.info, grey, views).psnr_db
    trained = run_steps(train_colors(grey, views, views, 0.5, torch.Generator().manual_seed(0)))
    assert before is not None and trained.info.psnr_db is not None and trained.info.psnr_db > before + 0.5
    assert torch.equal(trained.values[..., 0], grey.values[..., 0]) and trained.evidence is grey.evidence
    assert trained.info.iterations > 1 and trained.info.images == 12
