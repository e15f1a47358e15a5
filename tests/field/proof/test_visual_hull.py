"""Visual hulls of pictures that are cut out, and what is learned in them."""

from dataclasses import replace

import pytest
import torch

from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.field.proof.visual_hull import compute_hull, widen_silhouettes
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.field.train.config import TrainConfig
from nerfnav.field.train.grid_learner import GridLearner
from nerfnav.field.train.loop import first_learner
from nerfnav.field.train.rays import RaySampler
from nerfnav.geometry import Box, PosedImages, node_positions
from tests.field.fields import ball, photographs_of_ball

NEAR = Box.of((-0.4, -0.4, -0.4), (0.4, 0.4, 0.4))
SHAPE = (21, 21, 21)


def cut_out(count: int = 12, size: int = 48) -> PosedImages:
    """Pictures of the ball of radius 0.3 in the middle, cut out."""
    views = photographs_of_ball(count, size)
    shown = [render_image(ball(), views.camera, views.poses[k]).opacity > 0.1 for k in range(count)]
    return replace(views, silhouettes=torch.stack(shown))


def test_a_hull_holds_the_thing_and_little_more() -> None:
    views = cut_out()
    fine, coarse = (compute_hull(widen_silhouettes(views, NEAR, spacing), NEAR, SHAPE) for spacing in (0.01, 0.04))
    away = node_positions(NEAR, SHAPE).norm(dim=-1)
    assert fine[away < 0.3].all() and coarse[away < 0.33].all(), "nodes beside the ball may hold a part of it"
    assert 0.2 < float(fine.float().mean()) < 0.5, "the ball is 0.22 of the box"
    assert fine.sum() < coarse.sum()


@pytest.mark.slow
def test_one_picture_that_errs_takes_nothing_away() -> None:
    views = cut_out(60)
    assert views.silhouettes is not None
    views.silhouettes[7] = False
    assert compute_hull(widen_silhouettes(views, NEAR, 0.04), NEAR, SHAPE)[10, 10, 10]


def test_only_pictures_that_are_cut_out_have_a_hull() -> None:
    with pytest.raises(ValueError, match="not cut out"):
        widen_silhouettes(photographs_of_ball(3), NEAR, 0.1)


def test_learning_begins_in_the_hull_and_looks_where_silhouettes_are() -> None:
    views = cut_out()
    config = TrainConfig(voxel=0.01, iterations=10)
    learner, stage, depth, mask = first_learner(views, NEAR, ball().background, config, 1)
    assert isinstance(learner, GridLearner)
    assert (stage, depth) == (0, None)
    raw = learner.inner.values[..., 0]
    assert raw.min() == EMPTY_RAW < raw[10, 10, 10]
    assert mask is not None and views.silhouettes is not None
    assert mask[views.silhouettes].all() and not mask.all()
    batch = RaySampler(views, torch.Generator().manual_seed(0), mask).draw(200)
    shown = {tuple(color) for color in (views.images[mask].double() / 255).round(decimals=4).tolist()}
    assert all(tuple(color) in shown for color in torch.from_numpy(batch.targets).double().round(decimals=4).tolist())


def test_a_subset_of_pictures_keeps_its_silhouettes() -> None:
    views = cut_out(4)
    part = views.subset([1, 3])
    assert part.silhouettes is not None and views.silhouettes is not None
    assert torch.equal(part.silhouettes, views.silhouettes[[1, 3]])
