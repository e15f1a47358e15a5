"""Plan: a trajectory through the bundled Stonehenge, optimised in its radiance field and judged on its true mesh."""

import nerfnav
import nerfnav_scenes as scenes


def main() -> None:
    """Plan the scene's first task, and print what the plan costs and risks."""
    scene, robot = scenes.load("stonehenge"), nerfnav.Quadrotor()
    field = nerfnav.load_field(scenes.trained_path("stonehenge"))
    task = scene.tasks[0]
    problem = nerfnav.PlanProblem(field, robot, task.start_state, task.goal_state, steps=20, dt=0.1)

    result = nerfnav.plan(problem)
    if result.outcome is not nerfnav.PlanOutcome.CONVERGED:
        raise SystemExit(f"no plan to fly: {result.outcome.value}")
    motion = result.motion
    print(f"{task.name}: {len(motion.actions)} actions in {len(motion.actions) * motion.dt:.1f} s")
    print(f"J = {result.cost.total:.2f}: collision {result.cost.collision:.2f}, control {result.cost.control:.2f}")
    length = motion.states.position.diff(dim=0).norm(dim=-1).sum().item()
    print(f"length: {length:.2f} m, at most {motion.states.velocity.norm(dim=-1).max().item():.2f} m/s")
    print(f"largest thrust: {motion.actions[:, 0].max().item():.2f} N of {robot.config.max_thrust:.2f} N")

    report = nerfnav.judge(scene, robot.body, motion.states)
    print(f"judged at {len(report.overlap_m3)} poses: overlap with the stones {report.max_overlap_m3:.1e} m^3")


if __name__ == "__main__":
    main()
