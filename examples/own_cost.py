"""Add a cost: make a differentiable function of the motion a term of J, here one that keeps the robot low."""

from dataclasses import replace

import torch

import nerfnav
import nerfnav_scenes as scenes

CEILING = 0.3
"""Height above which the term is positive [m]."""
WEIGHT = 2000.0
"""Weight of the squared height above it, summed over the steps [1/m^2]."""


def height(_: object, motion: nerfnav.Motion) -> torch.Tensor:
    """sum_t max(z_t - CEILING, 0)^2 [m^2]."""
    return (motion.states.position[..., 2] - CEILING).clamp_min(0).square().sum(-1)


def main() -> None:
    """Plan one task with and without the term."""
    scene, robot = scenes.load("stonehenge"), nerfnav.Quadrotor()
    field = nerfnav.load_field(scenes.trained_path("stonehenge"))
    start, goal = nerfnav.RigidState.at_rest((0.39, -0.67, 0.25)), nerfnav.RigidState.at_rest((-0.4, 0.55, 0.35))
    problem = nerfnav.PlanProblem(field, robot, start, goal)
    stay_low = nerfnav.CostTerm("height", height, WEIGHT)
    for name, terms in (("without", problem.terms), ("with", (*problem.terms, stay_low))):
        result = nerfnav.plan(replace(problem, terms=terms))
        above = (result.motion.states.position[:, 2] - CEILING).clamp_min(0).sum().item()
        overlap = nerfnav.judge(scene, robot.body, result.motion.states).max_overlap_m3
        outcome = result.outcome.name.lower()
        print(f"{name} the term: {outcome}, above {CEILING} m by {above:.3f} m in all")
        for term in result.cost.added:
            print(f"  {term.name}: {term.value:.3f} of J, {term.ms:.2f} ms an evaluation")
        print(f"  J = {result.cost.total:.2f}, overlap with the stones {overlap:.1e} m^3")


if __name__ == "__main__":
    main()
