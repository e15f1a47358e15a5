"""Add a robot: a blimp with velocity commands, planned by the same planner as the bundled robots.

Dynamics: p' = p + v dt, yaw' = yaw + r dt, (v, r)' = u. They are differentially flat in position and yaw. The start
fixes the first two rows of flat outputs and the goal fixes the last; the planner optimises the others.
"""

import torch
from torch import Tensor

import nerfnav
import nerfnav_scenes as scenes
from nerfnav.geometry import so3
from nerfnav.robots import Body


class Blimp(nerfnav.Robot):
    """A level body with four actions: velocity [m/s] and yaw rate [rad/s], reached within a step."""

    name, minimum_steps = "blimp", 3
    action_names = ("vx_mps", "vy_mps", "vz_mps", "yaw_rate_radps")
    action_weights = (0.1, 0.1, 0.1, 0.01)
    body = Body.box((0.12, 0.08, 0.08), (5, 3, 3))

    def step(self, state: nerfnav.RigidState, action: Tensor, dt: float) -> nerfnav.RigidState:
        """Integrate the velocities of the state, then take those of the action."""
        rate = torch.cat([torch.zeros_like(action[..., :2]), action[..., 3:]], -1)
        turned = so3.retract(state.rotation, state.body_rate * dt)
        return nerfnav.RigidState(state.position + state.velocity * dt, action[..., :3], turned, rate)

    def hold(self, state: nerfnav.RigidState, dt: float, turn: float = 0.0) -> Tensor:
        """Return the action that stops the robot and turns it."""
        return torch.tensor([0.0, 0.0, 0.0, turn])

    def motion(
        self, free: Tensor, start: nerfnav.RigidState, goal: nerfnav.RigidState, steps: int, dt: float
    ) -> nerfnav.Motion:
        """Compute states from rows (x, y, z, yaw): velocities are differences, actions the next row's velocities."""
        ends = [_flat(start), _flat(start) + dt * _rates(start), _flat(goal), _rates(goal)]
        first, second, last, last_rates = (end.expand(*free.shape[:-1], 1, 4) for end in ends)
        rows = torch.cat([first, second, free.unflatten(-1, (steps - 2, 4)), last], -2)
        rates = torch.cat([rows.diff(dim=-2) / dt, last_rates], -2)
        spin = torch.cat([torch.zeros_like(rates[..., :2]), rates[..., 3:]], -1)
        states = nerfnav.RigidState(rows[..., :3], rates[..., :3], so3.from_yaw(rows[..., 3]), spin)
        return nerfnav.Motion(states, rates[..., 1:, :], dt)

    def encode(self, waypoints: Tensor, start: nerfnav.RigidState, goal: nerfnav.RigidState, dt: float) -> Tensor:
        """Return the free rows unchanged."""
        return waypoints[2:-1].flatten()

    def free_scales(self, free: Tensor) -> Tensor:
        """Return the scale of each free variable: 0.1 m and 0.1 rad."""
        return torch.full_like(free, 0.1)


def _flat(state: nerfnav.RigidState) -> Tensor:
    return torch.cat([state.position, so3.yaw_of(state.rotation)[None]])


def _rates(state: nerfnav.RigidState) -> Tensor:
    return torch.cat([state.velocity, state.body_rate[2:]])


def main() -> None:
    """Plan for the blimp, and roll its actions out by its own dynamics."""
    scene, robot = scenes.load("stonehenge"), Blimp()
    field, task = nerfnav.load_field(scenes.trained_path("stonehenge")), scene.tasks[10]
    result = nerfnav.plan(nerfnav.PlanProblem(field, robot, task.start_state, task.goal_state, steps=20, dt=0.2))
    print(f"{result.outcome.name.lower()}: J = {result.cost.total:.3f}")
    state = task.start_state
    for action in result.motion.actions:
        state = robot.step(state, action, result.motion.dt)
    print(f"rolled out, it ends {1000 * (state.position - task.goal_state.position).norm().item():.3f} mm off the goal")
    overlap = nerfnav.judge(scene, robot.body, result.motion.states).max_overlap_m3
    print(f"fastest: {result.motion.states.velocity.norm(dim=-1).max().item():.2f} m/s, overlap {overlap:.1e} m^3")


if __name__ == "__main__":
    main()
