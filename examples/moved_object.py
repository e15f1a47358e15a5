"""Move an object: place a field inside a field, move it without training, and plan around it."""

import torch

import nerfnav
import nerfnav_scenes as scenes
from nerfnav.field import BallsField
from nerfnav.geometry import Box

RADIUS = 0.12  # [m]


def at(position: tuple[float, float, float]) -> nerfnav.Pose:
    """Return T_world_object without a rotation."""
    return nerfnav.Pose(torch.eye(3), torch.tensor(position))


def main() -> None:
    """Plan with a ball beside the path, then with the same ball in the middle of the path."""
    robot, stones = nerfnav.Quadrotor(), nerfnav.load_field(scenes.trained_path("stonehenge"))
    start, goal = nerfnav.RigidState.at_rest((0.39, -0.67, 0.2)), nerfnav.RigidState.at_rest((-0.4, 0.55, 0.16))
    box = Box.of((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2))
    ball = BallsField(box, centers=torch.zeros(1, 3), radii=torch.tensor([RADIUS]))
    place = nerfnav.CompositeField(
        (nerfnav.PlacedField(stones, at((0.0, 0.0, 0.0))), nerfnav.PlacedField(ball, at((0.6, 0.6, 0.3))))
    )
    first = nerfnav.plan(nerfnav.PlanProblem(place, robot, start, goal))
    middle = first.motion.states.position[10]
    moved = place.moved(1, nerfnav.Pose(torch.eye(3), middle))
    again = nerfnav.plan(nerfnav.PlanProblem(moved, robot, start, goal))
    for name, result in (("beside the path", first), ("in the path", again)):
        nearest = (result.motion.states.position - middle).norm(dim=-1).min().item()
        outcome = result.outcome.name.lower()
        print(f"ball {name}: {outcome}, J = {result.cost.total:.2f}, passes the middle at {100 * nearest:.1f} cm")
    print(f"the ball's radius is {100 * RADIUS:.0f} cm")


if __name__ == "__main__":
    main()
