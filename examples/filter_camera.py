"""Filter a camera: run the pose filter alone, from pictures to a pose with its covariance.

Put your own driver in place of `your_camera`. Here, it renders the true Stonehenge.
"""

import argparse

import torch

import nerfnav
import nerfnav_scenes as scenes
from nerfnav.geometry import FORWARD_MOUNT
from nerfnav.world import MeshRenderer

ROBOT = nerfnav.Quadrotor()
CAMERA = nerfnav.Camera.from_fov(200, 200, 90)  # Camera(..., distortion=(k1, k2, p1, p2, k3)) for a real lens
TRUTH = nerfnav.RigidState.at_rest((-0.9, 0.0, 0.3))
"""True state of the hovering robot. The filter never sees it."""


def your_camera(renderer: MeshRenderer) -> torch.Tensor:
    """A picture, uint8 (height, width, 3); None stands for a dropped frame."""
    return renderer.render(CAMERA, TRUTH.pose.compose(FORWARD_MOUNT)).image


def main(steps: int) -> None:
    """Begin with a belief that is 3 cm off, and correct it with ten pictures a second."""
    generator = torch.Generator().manual_seed(0)
    renderer = MeshRenderer(scenes.load("stonehenge"), supersample=2)
    estimator = nerfnav.FastFilter(nerfnav.load_field(scenes.trained_path("stonehenge")), ROBOT, CAMERA)
    mean = nerfnav.RigidState.at_rest((-0.88, 0.02, 0.31))
    belief = nerfnav.Belief(mean, nerfnav.StateNoise.isotropic(0.02**2).covariance())
    hover = torch.tensor([ROBOT.weight, 0.0, 0.0, 0.0])
    for step in range(steps):
        result = nerfnav.update(estimator, belief, your_camera(renderer), hover, 0.1, generator)
        belief = result.posterior
        off = 1000 * (belief.mean.position - TRUTH.position).norm().item()
        deviation = 1000 * belief.covariance.diagonal()[:3].sum().sqrt().item()
        print(f"step {step}: {result.outcome.name.lower()}, off by {off:.1f} mm, estimated {deviation:.1f} mm")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=5, help="number of pictures")
    main(parser.parse_args().steps)
