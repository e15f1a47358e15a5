"""Fly: run Algorithm 1 of the paper in simulation, with the camera's pictures of the true mesh as only sensor."""

import nerfnav
import nerfnav_scenes as scenes


def main() -> None:
    """Fly across the ring of Stonehenge, and print the result."""
    scene, robot = scenes.load("stonehenge"), nerfnav.Quadrotor()
    field = nerfnav.load_field(scenes.trained_path("stonehenge"))
    task = scene.tasks[10]
    problem = nerfnav.PlanProblem(field, robot, task.start_state, task.goal_state)

    episode = nerfnav.fly(problem, scene, seed=0)
    numbers = episode.metrics()
    print(f"{task.name}: {numbers['outcome']} after {len(episode.actions) * episode.dt:.1f} s")
    print(f"{100 * numbers['final_position_error_m']:.1f} cm from the goal, touched in {episode.touched.sum()} steps")
    estimation, timing = numbers["estimation"], numbers["timing_ms"]
    print(f"position error {1000 * estimation['position_rmse_m']:.1f} mm RMS, NEES {estimation['nees_mean']:.1f} of 12")
    print(f"a step took {timing['step_p50']:.0f} ms: filter {timing['filter_p50']:.0f} ms, the rest planning")
    for time, truth, mean in zip(episode.times, episode.truth.position, episode.beliefs.mean.position, strict=True):
        print(f"  {time:.1f} s  at {truth.tolist()} m, estimate off by {1000 * (truth - mean).norm():.1f} mm")


if __name__ == "__main__":
    main()
