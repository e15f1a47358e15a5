"""A moved object: a field inside a field. Nothing is learned again when it moves; the plan is made anew around it."""

import torch

import nerfnav
import nerfnav_scenes as scenes
from nerfnav.field.models.analytic import BallsField
from nerfnav.geometry.box import Box

RADIUS = 0.12  # [m]


def at(position: tuple[float, float, float]) -> nerfnav.Pose:
    """T_world_object of an object that is not turned."""
    return nerfnav.Pose(torch.eye(3), torch.tensor(position))


def main() -> None:
    """Plan past a ball beside the way, then past the same ball in the middle of it."""
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
    for name, last in (("beside the way", first), ("in the way", again)):
        nearest = (last.motion.states.position - middle).norm(dim=-1).min().item()
        outcome = last.outcome.name.lower() if last.outcome else "unfinished"
        print(f"ball {name}: {outcome}, J = {last.cost.total:.2f}, passes its place at {100 * nearest:.1f} cm")
    print(f"the ball's radius is {100 * RADIUS:.0f} cm")


if __name__ == "__main__":
    main()
