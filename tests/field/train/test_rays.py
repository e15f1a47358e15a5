"""Learning from points that structure from motion found."""

import torch

from nerfnav.field.train.grid_learner import GridLearner
from nerfnav.field.train.rays import PointSampler, points_of
from nerfnav.field.train.training_volume import Finish, TrainingVolume
from nerfnav.geometry import Box, Camera, PosedImages, Sightings, look_at

BOX = Box.of((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))


def photographs(sightings: Sightings) -> PosedImages:
    """Three grey pictures from the left."""
    eyes = torch.tensor([[-3.0, 0.0, 0.0], [-3.0, 0.5, 0.2], [-3.0, -0.5, -0.2]])
    images = torch.full((3, 12, 16, 3), 128, dtype=torch.uint8)
    return PosedImages(images, Camera.from_fov(16, 12, 60), look_at(eyes, torch.zeros(3, 3)), sightings=sightings)


def wall(count: int = 300) -> Sightings:
    """Points all over the plane x = 0.3, each seen by all three; and one far outside of the box."""
    generator = torch.Generator().manual_seed(2)
    points = 1.2 * torch.rand(count, 3, generator=generator) - 0.6
    points[:, 0] = 0.3
    points = torch.cat([points, torch.tensor([[9.0, 0.0, 0.0]])])
    image = torch.arange(3).repeat_interleave(count + 1)
    return Sightings(points, image, torch.arange(count + 1).repeat(3))


def test_sightings_follow_the_images_that_are_chosen_and_the_points_that_are_kept() -> None:
    seen = Sightings(torch.eye(3), torch.tensor([0, 2, 1, 2]), torch.tensor([0, 0, 1, 2]))
    chosen = photographs(seen).subset([2, 0]).sightings
    assert chosen is not None
    assert (chosen.image.tolist(), chosen.point.tolist()) == ([1, 0, 0], [0, 0, 2])
    kept = seen.where(torch.tensor([True, False, True]))
    assert torch.equal(kept.points, torch.eye(3)[[0, 2]])
    assert (kept.image.tolist(), kept.point.tolist()) == ([0, 2, 2], [0, 0, 1])


def test_rays_lead_from_cameras_to_points_of_the_box_alone() -> None:
    taken = photographs(wall())
    sampler = PointSampler(taken, BOX, torch.Generator().manual_seed(0))
    assert len(sampler) == 900
    assert len(sampler.draw(500).distances) == len(sampler.draw(29).distances) == 29  # 900 in 32 steps
    batch = sampler.draw(29)
    ends = batch.origins + batch.distances[:, None] * batch.directions
    assert abs(ends[:, 0] - 0.3).max() < 1e-5 and abs(ends).max() < 0.61
    eyes = {tuple(eye) for eye in taken.poses.position.numpy().round(3).tolist()}
    assert {tuple(origin) for origin in batch.origins.round(3).tolist()} == eyes


def test_there_is_nothing_to_draw_without_points_in_the_box_or_beside_depth_maps() -> None:
    generator, taken = torch.Generator(), photographs(wall())
    assert points_of(taken, BOX, generator) is not None
    assert points_of(photographs(wall(0)), BOX, generator) is None
    deep = PosedImages(taken.images, taken.camera, taken.poses, torch.ones(3, 12, 16), sightings=taken.sightings)
    assert points_of(deep, BOX, generator) is None


def test_fog_clears_before_points_and_thickens_at_them() -> None:
    taken = photographs(wall(3000))
    place = TrainingVolume(BOX, torch.zeros(3), 0.5)
    learner = GridLearner.start(place, (21, 21, 21), taken, workers=1)
    before = learner.so_far(Finish()).density(torch.tensor([[0.3, 0.0, 0.0], [-0.4, 0.0, 0.0]]))
    sampler = PointSampler(taken, BOX, torch.Generator().manual_seed(0))
    for _ in range(60):
        learner.add_points(sampler.draw(300), 1.0)
        learner.inner.descend(0.25, 0.0)
    at, ahead = learner.so_far(Finish()).density(torch.tensor([[0.3, 0.0, 0.0], [-0.4, 0.0, 0.0]])).tolist()
    assert at > 20 * before[0] and at > 5
    assert ahead < 0.2 * before[1] + 1e-3
