"""The pose filter alone: pictures of a camera go in, where the robot is and how sure of it comes out.

Put your own driver in place of `your_camera`; here pictures of the true Stonehenge stand for it.
"""

import argparse

import torch

import nerfnav
import nerfnav_scenes as scenes
from nerfnav.geometry.camera import FORWARD_MOUNT
from nerfnav.world.raycast import MeshRenderer

ROBOT = nerfnav.Quadrotor()
CAMERA = nerfnav.Camera.from_fov(200, 200, 90)  # Camera(..., distortion=(k1, k2, p1, p2, k3)) for a real lens
TRUTH = nerfnav.RigidState.at_rest((-0.9, 0.0, 0.3))
"""Where the robot really hovers; the filter never sees it."""


def your_camera(renderer: MeshRenderer) -> torch.Tensor:
    """A picture, uint8 (height, width, 3); None stands for a dropped frame."""
    return renderer.render(CAMERA, TRUTH.pose.compose(FORWARD_MOUNT)).image


def main(steps: int) -> None:
    """Begin with a belief that is 3 cm off, and correct it by one picture each tenth of a second."""
    generator = torch.Generator().manual_seed(0)
    renderer = MeshRenderer(scenes.load("stonehenge"), supersample=2)
    estimator = nerfnav.FastFilter(nerfnav.load_field(scenes.trained_path("stonehenge")), ROBOT, CAMERA)
    mean = nerfnav.RigidState.at_rest((-0.88, 0.02, 0.31))
    belief = nerfnav.Belief(mean, nerfnav.StateNoise.isotropic(0.02**2).covariance())
    hover = torch.tensor([ROBOT.weight, 0.0, 0.0, 0.0])
    for step in range(steps):
        *_, last = estimator.update(belief, your_camera(renderer), hover, 0.1, generator)
        assert last.posterior is not None and last.outcome is not None, "the last step has both"
        belief = last.posterior
        off = 1000 * (belief.mean.position - TRUTH.position).norm().item()
        spread = 1000 * belief.covariance.diagonal()[:3].sum().sqrt().item()
        print(f"step {step}: {last.outcome.name.lower()}, off by {off:.1f} mm, believes {spread:.1f} mm")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=5, help="pictures to look at")
    main(parser.parse_args().steps)
